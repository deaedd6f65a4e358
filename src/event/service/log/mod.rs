//! The log of an instrument's fixes in flash: appended record by record, the oldest overwritten.
//!
//! Two sectors of unequal size ([`LOG_SECTORS`]), so that a queue of equal pages, such as sequential-storage's, would have to leave half of the larger one unused. Each
//! begins with a [`Context`]; records follow each other. Where a sector is full the other one is erased and goes on, numbered one higher. Whatever a power cut
//! leaves of a record is skipped, by its check sum; whatever it leaves of an erase has no context at its beginning and is erased again.
//!
//! Erasing takes a board's processor a second: [`FixLog::prepare`] does it at power-up, before the first tick, where less than `RESERVE` places are left.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use north_boot::parts;

use super::flash::LOG_SECTORS;
use super::record::{self, CRASH_PART, Context, CrashPart, LENGTH, Logged, More, Place, Record};
use crate::event::restart::{Crash, WORDS};

/// Places of a sector below which the next one is erased at power-up: a day's fixes.
const RESERVE: u32 = 24;
/// Crashes between two fixes that are kept.
const MOST_CRASHES: u8 = 32;
/// Records of a crash.
const CRASH_PARTS: u8 = (4 * WORDS).div_ceil(CRASH_PART) as u8;
const RECORD: u32 = LENGTH as u32;

/// Where the log goes on, and what was told last.
#[derive(Clone, Copy, Debug, Default)]
pub struct FixLog {
    /// The sector that is written, and its next place; `None`: nothing is written yet.
    at: Option<(usize, u32)>,
    /// What holds at its end.
    context: Context,
    /// Of this power-up a fix is in it.
    switched_on: bool,
    /// Nothing is written in the sector that is next.
    ready: bool,
    /// Crashes since the last fix.
    crashes: u8,
}

/// Start and places of a sector.
fn sector(number: usize) -> (u32, u32) {
    let [first, second] = LOG_SECTORS;
    if number == 0 { (0, first / RECORD) } else { (first, second / RECORD) }
}

fn place<F: ReadNorFlash>(flash: &mut F, number: usize, at: u32) -> Result<Place, F::Error> {
    let mut bytes = [0; LENGTH];
    flash.read(sector(number).0 + at * RECORD, &mut bytes)?;
    Ok(record::read(&bytes))
}

/// The context at a sector's beginning; `None`: it has none, and holds nothing.
fn heading<F: ReadNorFlash>(flash: &mut F, number: usize) -> Result<Option<Context>, F::Error> {
    Ok(match place(flash, number, 0)? {
        Place::Holds(Record::Context(context)) => Some(context),
        _ => None,
    })
}

/// The sectors that hold something, the older one first, and their numbers in the order of writing.
fn written<F: ReadNorFlash>(flash: &mut F) -> Result<[Option<(usize, u32)>; 2], F::Error> {
    let of = |context: Option<Context>, number| context.map(|context| (number, context.sector));
    let both = [of(heading(flash, 0)?, 0), of(heading(flash, 1)?, 1)];
    let [first, second] = both;
    let later = |one: u32, other: u32| one.wrapping_sub(other).cast_signed() > 0;
    Ok(match both {
        [Some((_, one)), Some((_, other))] if later(one, other) => [second, first],
        _ => both,
    })
}

impl FixLog {
    /// Reads all that is in flash, in its order, to where it goes on.
    pub fn open<F: ReadNorFlash>(flash: &mut F, told: &mut dyn FnMut(&Record)) -> Result<Self, F::Error> {
        let mut log = Self::default();
        for (number, _) in written(flash)?.into_iter().flatten() {
            let (_, places) = sector(number);
            let mut next = 0;
            for at in 0..places {
                match place(flash, number, at)? {
                    // What was written in part is followed by others.
                    Place::Blank => break,
                    Place::Unreadable => {}
                    Place::Holds(record) => {
                        log.note(&record);
                        told(&record);
                    }
                }
                next = at + 1;
            }
            log.at = Some((number, next));
        }
        Ok(log)
    }

    /// Number of the last fix.
    pub fn fix(&self) -> u32 {
        self.context.fix
    }

    fn note(&mut self, record: &Record) {
        match record {
            Record::Context(context) => self.context = *context,
            Record::Fix(fix) => {
                self.context.fix = self.context.fix.wrapping_add(1);
                self.context.boot = self.context.boot.wrapping_add(fix.first.into());
                self.crashes = 0;
            }
            Record::Crash(CrashPart { number: 0, .. }) => self.crashes = self.crashes.saturating_add(1),
            Record::Crash(_) | Record::Check(_) | Record::More(_) => {}
        }
    }

    /// Makes the sector that is next ready where the one in use is nearly full, or where there is none: to look at all of a sector takes several ticks, to erase it
    /// several hundred.
    pub fn prepare<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), F::Error> {
        let next = match self.at {
            Some((number, next)) if sector(number).1 - next < RESERVE => 1 - number,
            Some(_) => return Ok(()),
            None => 0,
        };
        make_blank(flash, next)?;
        self.ready = true;
        Ok(())
    }

    /// Appends a fix. `firmware`, `model`: which program and which error model made it.
    pub fn push<F: NorFlash>(
        &mut self,
        flash: &mut F,
        fix: &Logged,
        firmware: u32,
        model: u32,
    ) -> Result<(), F::Error> {
        if (self.context.firmware, self.context.model) != (firmware, model) {
            let before = self.context;
            self.context = Context { firmware, model, ..before };
            // A sector begins with it anyway.
            if self.at.is_some_and(|(number, next)| next < sector(number).1)
                && let Err(error) = self.append(flash, &Record::Context(self.context))
            {
                self.context = before;
                return Err(error);
            }
        }
        let fix = Logged { first: !self.switched_on, ..*fix };
        self.append(flash, &Record::Fix(fix))?;
        self.switched_on = true;
        Ok(())
    }

    /// Says what else was measured with the last fix, if anything was.
    pub fn more<F: NorFlash>(&mut self, flash: &mut F, more: &More) -> Result<(), F::Error> {
        if *more == More::default() { Ok(()) } else { self.append(flash, &Record::More(*more)) }
    }

    /// Says at which surveyed azimuth the last fix was made.
    pub fn check<F: NorFlash>(&mut self, flash: &mut F, azimuth_deg: f64) -> Result<(), F::Error> {
        self.append(flash, &Record::Check(azimuth_deg))
    }

    /// Keeps what a crash left behind, unless it is one of too many since the last fix: a board that crashes at every start keeps its fixes.
    pub fn crash<F: NorFlash>(&mut self, flash: &mut F, crash: &Crash) -> Result<(), F::Error> {
        if self.crashes >= MOST_CRASHES {
            return Ok(());
        }
        let words = crash.to_words();
        let mut bytes = words.iter().flat_map(|word| word.to_le_bytes());
        for number in 0..CRASH_PARTS {
            let mut part = CrashPart { number, bytes: [0; CRASH_PART] };
            part.bytes.iter_mut().zip(&mut bytes).for_each(|(place, byte)| *place = byte);
            self.append(flash, &Record::Crash(part))?;
        }
        Ok(())
    }

    fn append<F: NorFlash>(&mut self, flash: &mut F, record: &Record) -> Result<(), F::Error> {
        let (number, at) = match self.at {
            Some((number, next)) if next < sector(number).1 => (number, next),
            Some((number, _)) => (self.begin(flash, 1 - number)?, 1),
            None => (self.begin(flash, 0)?, 1),
        };
        let written = flash.write(sector(number).0 + at * RECORD, &record.bytes());
        // What was written in part uses its place. A blank one would end the log for whoever reads it.
        let is_blank = written.is_err() && matches!(place(flash, number, at), Ok(Place::Blank));
        self.at = Some((number, at + u32::from(!is_blank)));
        written?;
        self.note(record);
        Ok(())
    }

    /// Begins a sector.
    fn begin<F: NorFlash>(&mut self, flash: &mut F, number: usize) -> Result<usize, F::Error> {
        if !core::mem::take(&mut self.ready) {
            make_blank(flash, number)?;
        }
        self.context.sector = self.context.sector.wrapping_add(1);
        flash.write(sector(number).0, &Record::Context(self.context).bytes())?;
        Ok(number)
    }
}

/// Erases a sector, unless nothing is written in it.
fn make_blank<F: NorFlash>(flash: &mut F, number: usize) -> Result<(), F::Error> {
    let (start, places) = sector(number);
    let end = start + places * RECORD;
    let is_blank = parts::all(flash, start..end, |part| part.iter().all(|&byte| byte == 0xFF))?;
    if is_blank { Ok(()) } else { flash.erase(start, end) }
}

/// Records as they are in flash, in the order of writing, from a place on; fewer than there is room for at the end.
///
/// Gives how many there are, and the place after them: 0 is the first.
pub fn read_places<F: ReadNorFlash>(
    flash: &mut F,
    from: u32,
    into: &mut [[u8; LENGTH]],
) -> Result<(usize, u32), F::Error> {
    let (mut count, mut before, mut next) = (0, 0, from);
    for (number, _) in written(flash)?.into_iter().flatten() {
        let (start, places) = sector(number);
        for at in from.saturating_sub(before)..places {
            let Some(bytes) = into.get_mut(count) else { return Ok((count, next)) };
            flash.read(start + at * RECORD, bytes)?;
            if record::read(bytes) == Place::Blank {
                break;
            }
            count += 1;
            next = before + at + 1;
        }
        before += places;
    }
    Ok((count, next))
}

#[cfg(test)]
mod tests;

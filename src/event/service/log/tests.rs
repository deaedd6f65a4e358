extern crate std;

use std::vec::Vec;

use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind};

use super::*;
use crate::event::restart::Cause;

const BYTES: usize = (LOG_SECTORS[0] + LOG_SECTORS[1]) as usize;

/// Two unequal sectors of words of four bytes that are written once after an erase; power can fail after any byte, an erase takes as long as 8.
#[derive(Clone)]
struct Flash {
    bytes: Vec<u8>,
    power_left: usize,
    erases: usize,
}

#[derive(Debug)]
struct Failed;

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Flash {
    fn erased() -> Self {
        Self { bytes: std::vec![0xFF; BYTES], power_left: usize::MAX, erases: 0 }
    }

    fn spend(&mut self) -> Result<(), Failed> {
        self.power_left = self.power_left.checked_sub(1).ok_or(Failed)?;
        Ok(())
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let from = offset as usize;
        bytes.copy_from_slice(self.bytes.get(from..from + bytes.len()).ok_or(Failed)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 64 * 1024;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        let whole = [(0, LOG_SECTORS[0]), (LOG_SECTORS[0], BYTES as u32)];
        assert!(whole.contains(&(from, to)), "not a sector: {from} to {to}");
        self.erases += 1;
        for part in self.bytes[from as usize..to as usize].chunks_mut((to - from) as usize / 8) {
            self.power_left = self.power_left.checked_sub(1).ok_or(Failed)?;
            part.fill(0xFF);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        for (at, byte) in (offset as usize..).zip(bytes) {
            if at.is_multiple_of(4) {
                assert!(self.bytes[at..at + 4].iter().all(|&byte| byte == 0xFF), "written twice: {at}");
            }
            self.spend()?;
            self.bytes[at] = *byte;
        }
        Ok(())
    }
}

/// The fix of a number, which its time is.
fn fix(number: u32) -> Logged {
    Logged { t_s: number, azimuth_deg: 90.0, ..Logged::default() }
}

fn open(flash: &mut Flash) -> (FixLog, Vec<u32>) {
    let mut numbers = Vec::new();
    let log = FixLog::open(flash, &mut |record| {
        if let Record::Fix(fix) = record {
            numbers.push(fix.t_s);
        }
    });
    (log.unwrap(), numbers)
}

/// A log with so many fixes, all of one switch-on.
fn filled(count: u32) -> Flash {
    let mut flash = Flash::erased();
    let mut log = FixLog::default();
    (1..=count).for_each(|number| log.push(&mut flash, &fix(number), 1, 2).unwrap());
    flash
}

/// The least is left when the larger sector was erased and the smaller one is full: 65536/32 − 1 records, less those that the reserve takes; a fix is one,
/// two with what only some instruments measure.
#[test]
fn two_thousand_fixes_are_there_at_any_time() {
    let block = More { block_temp_c: Some(20.0), ..More::default() };
    for (more, each) in [(More::default(), 1), (block, 2)] {
        let (mut flash, mut log) = (Flash::erased(), FixLog::default());
        let last = 14_000 / each;
        for number in 1..=last {
            if number % 97 == 0 {
                (log, _) = open(&mut flash);
                log.prepare(&mut flash).unwrap();
            }
            log.push(&mut flash, &fix(number), 1, 2).unwrap();
            log.more(&mut flash, &more).unwrap();
            if number > 6100 / each && number % 50 == 0 {
                let (_, numbers) = open(&mut flash);
                assert!(numbers.len() as u32 >= 2000 / each, "{} at {number}", numbers.len());
                assert_eq!(numbers, (number + 1 - numbers.len() as u32..=number).collect::<Vec<_>>());
            }
        }
        assert_eq!(log.fix(), last);
        assert!(flash.erases >= 3);
    }
}

#[test]
fn a_power_cut_at_any_byte_costs_the_fix_that_is_written_and_no_other() {
    // Before the end of the first sector; of the second, where the first is erased.
    for start in [2045, 6140] {
        let full = filled(start);
        for power in 0..6 * LENGTH + 16 {
            let mut flash = Flash { power_left: power, ..full.clone() };
            let (mut log, before) = open(&mut flash);
            let done = (start + 1..=start + 5).take_while(|&number| log.push(&mut flash, &fix(number), 1, 2).is_ok());
            let done = start + done.count() as u32;
            flash.power_left = usize::MAX;
            let (mut log, numbers) = open(&mut flash);
            // One that was written to its end may be there though nobody heard of it.
            let last = *numbers.last().unwrap();
            assert!((done..=done + 1).contains(&last), "{power}: {last} after {done}");
            assert!(numbers.windows(2).all(|two| two[1] == two[0] + 1) && numbers.len() >= 2000, "{power}");
            assert!(numbers[0] == before[0] || numbers[0] == 2047 + 1, "{power}: {}", numbers[0]);
            assert_eq!(log.fix(), last);
            // And it goes on.
            (last + 1..last + 8).for_each(|number| log.push(&mut flash, &fix(number), 1, 2).unwrap());
            let (log, numbers) = open(&mut flash);
            assert_eq!((numbers.last(), log.fix()), (Some(&(last + 7)), last + 7));
        }
    }
}

#[test]
fn switch_ons_are_counted_and_programs_and_models_told() {
    let mut flash = Flash::erased();
    for (boot, model) in [(1, 7), (2, 7), (3, 8)] {
        let (mut log, _) = open(&mut flash);
        (0..3).for_each(|number| log.push(&mut flash, &fix(10 * boot + number), 5, model).unwrap());
        assert_eq!(log.context.boot, boot);
        log.check(&mut flash, 12.5).unwrap();
    }
    let mut told = Vec::new();
    FixLog::open(&mut flash, &mut |record| told.push(*record)).unwrap();
    let contexts: Vec<_> = told
        .iter()
        .filter_map(|record| if let Record::Context(context) = record { Some(*context) } else { None })
        .collect();
    let context = |fix, boot, model| Context { sector: 1, fix, boot, firmware: 5, model };
    assert_eq!(contexts, [context(0, 0, 7), context(6, 2, 8)]);
    assert_eq!(told.iter().filter(|record| **record == Record::Check(12.5)).count(), 3);
    let firsts = told.iter().filter(|record| matches!(record, Record::Fix(fix) if fix.first)).count();
    assert_eq!(firsts, 3);
}

#[test]
fn places_are_read_in_the_order_of_writing() {
    let mut flash = filled(7000);
    let (mut from, mut numbers) = (0, Vec::new());
    loop {
        let mut room = [[0; LENGTH]; 3];
        let (count, next) = read_places(&mut flash, from, &mut room).unwrap();
        if count == 0 {
            break;
        }
        assert!(next > from);
        from = next;
        let fixes = room[..count].iter().filter_map(|bytes| match record::read(bytes) {
            Place::Holds(Record::Fix(fix)) => Some(fix.t_s),
            _ => None,
        });
        numbers.extend(fixes);
    }
    let (_, all) = open(&mut flash);
    assert_eq!(numbers, all);
}

#[test]
fn crashes_are_kept_and_no_more_than_thirty_two_between_two_fixes() {
    let mut flash = filled(3);
    for number in 0..40 {
        let (mut log, _) = open(&mut flash);
        log.crash(&mut flash, &Crash { line: number, ..Crash::new(Cause::Panic) }).unwrap();
    }
    let mut words = Vec::new();
    FixLog::open(&mut flash, &mut |record| {
        if let Record::Crash(part) = record {
            words.extend_from_slice(&part.bytes);
        }
    })
    .unwrap();
    let crashes: Vec<Crash> = words
        .chunks(4 * WORDS)
        .map(|bytes| {
            let mut words = [0; WORDS];
            words.iter_mut().zip(bytes.as_chunks().0).for_each(|(word, bytes)| *word = u32::from_le_bytes(*bytes));
            Crash::of_words(&words).unwrap()
        })
        .collect();
    assert_eq!(crashes.iter().map(|crash| crash.line).collect::<Vec<_>>(), (0..32).collect::<Vec<_>>());
    // The next fix makes room for others.
    let (mut log, _) = open(&mut flash);
    log.push(&mut flash, &fix(4), 1, 2).unwrap();
    let next = log.at;
    log.crash(&mut flash, &Crash::new(Cause::Watchdog)).unwrap();
    assert_eq!(log.at, next.map(|(sector, at)| (sector, at + 4)));
}

/// A full sector is followed by one with the new error model at its head: no two sectors have one number.
#[test]
fn another_model_at_a_full_sector_is_at_the_head_of_the_next() {
    let (mut flash, mut log) = (Flash::erased(), FixLog::default());
    let places = LOG_SECTORS[0] / RECORD;
    (1..places).for_each(|number| log.push(&mut flash, &fix(number), 1, 1).unwrap());
    log.push(&mut flash, &fix(places), 1, 2).unwrap();
    let heads = [0, 1].map(|number| heading(&mut flash, number).unwrap().unwrap());
    assert_eq!(heads.map(|head| (head.sector, head.model, head.fix)), [(1, 1, 0), (2, 2, places - 1)]);
    assert_eq!(open(&mut flash).1, (1..=places).collect::<Vec<u32>>());
}

/// What could not be written of a new error model is written before the next fix.
#[test]
fn a_model_that_could_not_be_written_is_written_again() {
    let (mut flash, mut log) = (Flash::erased(), FixLog::default());
    log.push(&mut flash, &fix(1), 1, 1).unwrap();
    flash.power_left = 0;
    assert!(log.push(&mut flash, &fix(2), 1, 2).is_err());
    flash.power_left = usize::MAX;
    log.push(&mut flash, &fix(3), 1, 2).unwrap();
    let (mut models, mut model) = (Vec::new(), 0);
    FixLog::open(&mut flash, &mut |record| match record {
        Record::Context(context) => model = context.model,
        Record::Fix(fix) => models.push((fix.t_s, model)),
        _ => {}
    })
    .unwrap();
    assert_eq!(models, [(1, 1), (3, 2)]);
}

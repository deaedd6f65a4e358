//! Settings in flash, appended record by record: a power cut while one is written leaves those before it.
//!
//! The flash has two halves. Records follow each other in one of them, each from a multiple of 16 bytes on; when there is no
//! room for another one, the other half is erased and goes on. A record, little-endian:
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | magic, `NFST` |
//! | 4 | 2 | version of the format |
//! | 6 | 2 | length n of the settings |
//! | 8 | 4 | sequence number, one more with every record |
//! | 12 | n | the settings, in postcard's encoding |
//! | 12 + n | 4 | CRC-32/ISO-HDLC of all before |
//!
//! The valid record with the latest sequence number counts. Erasing takes a board's processor half a second: [`prepare`] does it
//! at power-up, before there is a need.
//!
//! Records of the five versions before are read as well; those of any other are as good as corrupt.

mod content;

use core::ops::RangeInclusive;

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use north_boot::{CRC_32, parts};

use super::Settings;
use crate::event::bytes::{Bytes, CAPACITY, Piece};
use crate::health::Refusal;

const MAGIC: [u8; 4] = *b"NFST";
/// Changes whenever the meaning of a record does.
pub const VERSION: u16 = 11;
/// Those that are read.
const READ: RangeInclusive<u16> = 6..=VERSION;
const HEADER: usize = 12;
const CRC_LENGTH: usize = 4;
/// Longest record; a multiple of [`GRAIN`], and within a half. The longest settings that are valid fit: a test
/// says so.
const MAX_RECORD: usize = 6144;
/// Longest settings in it.
pub const MAX_SETTINGS: usize = MAX_RECORD - HEADER - CRC_LENGTH;
/// Records begin at multiples of this, which every flash's word divides.
const GRAIN: usize = 16;
/// A record is written in parts of this many bytes.
const PART: usize = 64;

/// What the flash holds.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // Without a heap there is no other place for settings.
pub enum Loaded {
    /// Nothing was ever stored.
    Missing,
    /// Something was stored, and its check fails; or it is of another version.
    Corrupt,
    Valid(Settings),
}

/// The same, without the settings themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    Missing,
    Corrupt,
    Valid,
}

/// Why settings could not be saved. `E` is the flash's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError<E> {
    Flash(E),
    /// The settings are longer than a record can be.
    TooLong,
    /// The flash does not hold what was written.
    NotVerified,
}

/// Why settings could not be changed. `E` is the flash's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateError<E> {
    /// There are none, or they are corrupt.
    Nothing,
    Save(SaveError<E>),
}

/// Where a valid record is.
#[derive(Clone, Copy)]
struct Place {
    half: usize,
    at: u32,
    sequence: u32,
    version: u16,
    /// Of the settings alone.
    length: usize,
}

/// What is in flash: the record that counts, and where each half begins to be unused.
struct Contents {
    newest: Option<Place>,
    unused: [u32; 2],
}

impl Contents {
    fn is_erased(&self, flash: &impl ReadNorFlash) -> bool {
        self.unused == [0, 1].map(|half| half_start(flash, half))
    }
}

/// The settings that were saved last.
pub fn load<F: ReadNorFlash>(flash: &mut F) -> Result<Loaded, F::Error> {
    let mut settings = Settings::default();
    Ok(match load_into(flash, &mut [0; MAX_SETTINGS], &mut settings)? {
        Found::Missing => Loaded::Missing,
        Found::Corrupt => Loaded::Corrupt,
        Found::Valid => Loaded::Valid(settings),
    })
}

/// The settings that were saved last, read to where they stay: on a board copies of them are dear. Where nothing valid is found,
/// `settings` may be anything. `scratch` has room for [`MAX_SETTINGS`] bytes.
pub fn load_into<F: ReadNorFlash>(
    flash: &mut F,
    scratch: &mut [u8],
    settings: &mut Settings,
) -> Result<Found, F::Error> {
    let contents = look_into(flash)?;
    let Some(Place { at, version, length, .. }) = contents.newest else {
        return Ok(if contents.is_erased(flash) { Found::Missing } else { Found::Corrupt });
    };
    let Some(content) = scratch.get_mut(..length) else { return Ok(Found::Corrupt) };
    flash.read(at + HEADER as u32, content)?;
    Ok(decode(version, content, settings).map_or(Found::Corrupt, |()| Found::Valid))
}

/// Settings as a record of this version holds them, read to where they stay. `None` where the version is not known, or they are
/// none; `settings` may be anything then.
pub fn decode(version: u16, content: &[u8], settings: &mut Settings) -> Option<()> {
    READ.contains(&version).then(|| content::read(content, version, settings))?
}

/// A piece of the settings that were saved last, as they are in flash, from `offset` on; an empty one at their end.
///
/// Errors: there are none, or they are corrupt; the offset is beyond them.
#[inline(never)]
pub fn read_piece<F: ReadNorFlash>(flash: &mut F, offset: u16) -> Result<Piece, Refusal> {
    let contents = look_into(flash).map_err(|_| Refusal::SettingsCorrupt)?;
    let Some(Place { at, version, length, .. }) = contents.newest else {
        return Err(if contents.is_erased(flash) { Refusal::NoSettings } else { Refusal::SettingsCorrupt });
    };
    let (start, length) = (usize::from(offset), u16::try_from(length).map_err(|_| Refusal::SettingsCorrupt)?);
    let left = usize::from(length).checked_sub(start).ok_or(Refusal::OutOfOrder)?;
    let mut bytes = [0; CAPACITY];
    let bytes = bytes.get_mut(..left.min(CAPACITY)).ok_or(Refusal::OutOfOrder)?;
    flash.read(at + HEADER as u32 + u32::from(offset), bytes).map_err(|_| Refusal::SettingsCorrupt)?;
    Ok(Piece { version, length, offset, bytes: Bytes::start_of(bytes) })
}

/// Saves settings after the record before, or in the other half where there is no room. Until that is complete, [`load`] finds
/// what it found before.
pub fn save<F: NorFlash>(flash: &mut F, settings: &Settings) -> Result<(), SaveError<F::Error>> {
    save_in(flash, &mut [0; MAX_SETTINGS], settings)
}

fn save_in<F: NorFlash>(flash: &mut F, scratch: &mut [u8], settings: &Settings) -> Result<(), SaveError<F::Error>> {
    let content = postcard::to_slice(settings, scratch).map_err(|_| SaveError::TooLong)?;
    save_encoded(flash, VERSION, content)
}

/// The same of settings that are encoded already, as records of a version that is known hold them.
#[inline(never)]
pub fn save_encoded<F: NorFlash>(flash: &mut F, version: u16, content: &[u8]) -> Result<(), SaveError<F::Error>> {
    if content.len() > MAX_SETTINGS {
        return Err(SaveError::TooLong);
    }
    let Contents { newest, unused: [first, second] } = look_into(flash).map_err(SaveError::Flash)?;
    let (half, sequence) = newest.map_or((0, 0), |newest| (newest.half, newest.sequence.wrapping_add(1)));
    let length = (HEADER + content.len() + CRC_LENGTH).next_multiple_of(GRAIN);

    let mut at = if half == 0 { first } else { second };
    if at + length as u32 > half_start(flash, half + 1) {
        let other = 1 - half;
        at = half_start(flash, other);
        if [first, second].get(other) != Some(&at) {
            flash.erase(at, half_start(flash, other + 1)).map_err(SaveError::Flash)?;
        }
    }
    write(flash, at, length, record(version, sequence, content))
}

/// The bytes of a record, and after its end those of an erased flash.
fn record(version: u16, sequence: u32, content: &[u8]) -> impl Iterator<Item = u8> {
    let header = (MAGIC.into_iter().chain(version.to_le_bytes()))
        .chain((content.len() as u16).to_le_bytes())
        .chain(sequence.to_le_bytes());
    let mut digest = CRC_32.digest();
    header.clone().for_each(|byte| digest.update(&[byte]));
    digest.update(content);
    header.chain(content.iter().copied()).chain(digest.finalize().to_le_bytes()).chain(core::iter::repeat(0xFF))
}

/// Writes the first `length` bytes, a multiple of [`GRAIN`], in parts, and reads every part again.
fn write<F: NorFlash>(
    flash: &mut F,
    at: u32,
    length: usize,
    mut bytes: impl Iterator<Item = u8>,
) -> Result<(), SaveError<F::Error>> {
    let end = at + length as u32;
    for at in (at..end).step_by(PART) {
        let (mut part, mut read) = ([0; PART], [0; PART]);
        let length = ((end - at) as usize).min(PART);
        let (Some(part), Some(read)) = (part.get_mut(..length), read.get_mut(..length)) else { break };
        part.iter_mut().zip(&mut bytes).for_each(|(place, byte)| *place = byte);
        flash.write(at, part).map_err(SaveError::Flash)?;
        flash.read(at, read).map_err(SaveError::Flash)?;
        if read != part {
            return Err(SaveError::NotVerified);
        }
    }
    Ok(())
}

/// Erases the other half where the half in use has no room for the longest record: then nothing needs to be erased while the
/// instrument works.
pub fn prepare<F: NorFlash>(flash: &mut F) -> Result<(), F::Error> {
    let Contents { newest, unused } = look_into(flash)?;
    let Some(Place { half, .. }) = newest else { return Ok(()) };
    let (other, end) = (1 - half, half_start(flash, half + 1));
    let start = half_start(flash, other);
    let full = unused.get(half).is_none_or(|unused| unused + MAX_RECORD as u32 > end);
    if full && unused.get(other) != Some(&start) {
        flash.erase(start, half_start(flash, other + 1))?;
    }
    Ok(())
}

/// Changes the settings that were saved last, and saves them.
///
/// `scratch` has room for [`MAX_SETTINGS`] bytes. Errors: [`UpdateError::Nothing`] where none can be loaded; otherwise as [`save`].
///
/// Never inlined: the settings shall take the caller's stack only while they are changed.
#[inline(never)]
pub fn update<F: NorFlash>(
    flash: &mut F,
    scratch: &mut [u8],
    change: impl FnOnce(&mut Settings),
) -> Result<(), UpdateError<F::Error>> {
    let mut settings = Settings::default();
    match load_into(flash, scratch, &mut settings) {
        Ok(Found::Valid) => {
            change(&mut settings);
            save_in(flash, scratch, &settings).map_err(UpdateError::Save)
        }
        Ok(Found::Missing | Found::Corrupt) => Err(UpdateError::Nothing),
        Err(error) => Err(UpdateError::Save(SaveError::Flash(error))),
    }
}

/// Whether `first` comes after `second`, over the wrap of the numbers.
fn later(first: u32, second: u32) -> bool {
    first.wrapping_sub(second).cast_signed() > 0
}

fn half_start(flash: &impl ReadNorFlash, half: usize) -> u32 {
    (flash.capacity() / 2 * half) as u32
}

/// Looks for records at every place where one can begin: what is damaged hides none that comes after it.
fn look_into<F: ReadNorFlash>(flash: &mut F) -> Result<Contents, F::Error> {
    let mut contents = Contents { newest: None, unused: [0, 1].map(|half| half_start(flash, half)) };
    for (half, unused) in contents.unused.iter_mut().enumerate() {
        let (mut at, end) = (half_start(flash, half), half_start(flash, half + 1));
        while at < end {
            let mut start = [0; GRAIN];
            flash.read(at, &mut start)?;
            let mut next = at + GRAIN as u32;
            if start.iter().any(|&byte| byte != 0xFF) {
                // What was begun may have been written to its end.
                let claimed = claimed(&start).filter(|&(_, _, length)| length <= (end - at) as usize);
                let used = claimed.map_or(GRAIN, |(_, _, length)| length.next_multiple_of(GRAIN)) as u32;
                *unused = (at + used).max(*unused);
                if let Some((version, sequence, length)) = claimed
                    && is_whole(flash, at, length)?
                {
                    let length = length - HEADER - CRC_LENGTH;
                    if contents.newest.is_none_or(|newest| later(sequence, newest.sequence)) {
                        contents.newest = Some(Place { half, at, sequence, version, length });
                    }
                    next = at + used;
                }
            }
            at = next;
        }
    }
    Ok(contents)
}

/// What a record's start says: version, sequence number, and length of all of it.
fn claimed(start: &[u8; GRAIN]) -> Option<(u16, u32, usize)> {
    let [m0, m1, m2, m3, v0, v1, l0, l1, n0, n1, n2, n3, ..] = *start;
    let version = u16::from_le_bytes([v0, v1]);
    let length = HEADER + usize::from(u16::from_le_bytes([l0, l1])) + CRC_LENGTH;
    let sound = [m0, m1, m2, m3] == MAGIC && READ.contains(&version) && length <= MAX_RECORD;
    sound.then_some((version, u32::from_le_bytes([n0, n1, n2, n3]), length))
}

/// Whether the check sum of a record is right.
fn is_whole<F: ReadNorFlash>(flash: &mut F, at: u32, length: usize) -> Result<bool, F::Error> {
    let mut digest = CRC_32.digest();
    let end = at + (length - CRC_LENGTH) as u32;
    parts::each(flash, at..end, |part| digest.update(part))?;
    let mut check = [0; CRC_LENGTH];
    flash.read(end, &mut check)?;
    Ok(digest.finalize() == u32::from_le_bytes(check))
}

#[cfg(test)]
pub mod longest;
#[cfg(test)]
mod tests;

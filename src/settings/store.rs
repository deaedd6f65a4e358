//! Settings in flash, in two slots: a power cut while one is written leaves the other.
//!
//! Each half of the flash is a slot. A record in a slot, little-endian:
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
//! The valid record with the later sequence number counts. [`save`] erases and writes the other slot.
//!
//! Records of the version before are read as well; those of any other are as good as corrupt.

mod version_4;

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use serde::Deserialize;

use super::Settings;
use crate::bytes::Piece;
use crate::health::Refusal;
use version_4::Settings4;

const MAGIC: [u8; 4] = *b"NFST";
/// Changes whenever the meaning of a record does.
pub const VERSION: u16 = 5;
/// The version before, which is read.
const OLD_VERSION: u16 = 4;
const HEADER: usize = 12;
const CRC_LENGTH: usize = 4;
/// Longest record; a multiple of every flash's word, and within a sector. The longest settings that are valid fit: a test
/// says so.
const MAX_RECORD: usize = 2560;
/// Longest settings in it.
pub const MAX_SETTINGS: usize = MAX_RECORD - HEADER - CRC_LENGTH;
/// What was written is read back in pieces of this many bytes.
const PIECE: usize = 256;

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

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

/// What is in one slot.
#[derive(Clone, Copy)]
enum Slot {
    Erased,
    Corrupt,
    /// A record that passes its checks, and its sequence number.
    Valid(u32),
}

/// A slot's first bytes.
type Record = [u8; MAX_RECORD];

/// The settings that were saved last.
pub fn load<F: ReadNorFlash>(flash: &mut F) -> Result<Loaded, F::Error> {
    let mut record = [0; MAX_RECORD];
    Ok(match read_newest(flash, &mut record)? {
        Slot::Erased => Loaded::Missing,
        Slot::Corrupt => Loaded::Corrupt,
        Slot::Valid(_) => decode(&record).map_or(Loaded::Corrupt, Loaded::Valid),
    })
}

/// A piece of the settings that were saved last, as they are in flash, from `offset` on; an empty one at their end.
///
/// Errors: there are none, or they are corrupt; the offset is beyond them.
#[inline(never)]
pub fn read_piece<F: ReadNorFlash>(flash: &mut F, offset: u16) -> Result<Piece, Refusal> {
    let mut record = [0; MAX_RECORD];
    match read_newest(flash, &mut record) {
        Ok(Slot::Erased) => return Err(Refusal::NoSettings),
        Ok(Slot::Corrupt) | Err(_) => return Err(Refusal::SettingsCorrupt),
        Ok(Slot::Valid(_)) => {}
    }
    let (version, end) = check(&record).ok_or(Refusal::SettingsCorrupt)?;
    let content = record.get(HEADER..end).ok_or(Refusal::SettingsCorrupt)?;
    Piece::of(version, content, offset.into()).ok_or(Refusal::OutOfOrder)
}

/// Reads the record that was saved last: whether there is one.
fn read_newest<F: ReadNorFlash>(flash: &mut F, record: &mut Record) -> Result<Slot, F::Error> {
    let slots = [look_into(flash, 0, record)?, look_into(flash, 1, record)?];
    let Some((newest, sequence)) = newest(slots) else {
        let erased = matches!(slots, [Slot::Erased, Slot::Erased]);
        return Ok(if erased { Slot::Erased } else { Slot::Corrupt });
    };
    flash.read(slot_start(flash, newest), record)?;
    Ok(Slot::Valid(sequence))
}

/// Saves settings over the older record. Until that is complete, [`load`] finds what it found before.
pub fn save<F: NorFlash>(flash: &mut F, settings: &Settings) -> Result<(), SaveError<F::Error>> {
    let mut record = [0; MAX_RECORD];
    let mut look = |slot| look_into(flash, slot, &mut record).map_err(SaveError::Flash);
    let (slot, sequence) = match newest([look(0)?, look(1)?]) {
        Some((newest, sequence)) => (1 - newest, sequence.wrapping_add(1)),
        None => (0, 0),
    };

    record.fill(0xFF);
    let length = encode(settings, sequence, &mut record).ok_or(SaveError::TooLong)?;
    let written = record.get(..length.next_multiple_of(F::WRITE_SIZE)).ok_or(SaveError::TooLong)?;
    let start = slot_start(flash, slot);
    flash.erase(start, slot_start(flash, slot + 1)).map_err(SaveError::Flash)?;
    flash.write(start, written).map_err(SaveError::Flash)?;

    let mut at = start;
    for piece in written.chunks(PIECE) {
        let mut read = [0; PIECE];
        let read = read.get_mut(..piece.len()).ok_or(SaveError::NotVerified)?;
        flash.read(at, read).map_err(SaveError::Flash)?;
        if read != piece {
            return Err(SaveError::NotVerified);
        }
        at += piece.len() as u32;
    }
    Ok(())
}

/// Changes the settings that were saved last, and saves them.
///
/// Errors: [`UpdateError::Nothing`] where none can be loaded; otherwise as [`save`].
///
/// Never inlined: the settings shall take the caller's stack only while they are changed.
#[inline(never)]
pub fn update<F: NorFlash>(flash: &mut F, change: impl FnOnce(&mut Settings)) -> Result<(), UpdateError<F::Error>> {
    match load(flash) {
        Ok(Loaded::Valid(mut settings)) => {
            change(&mut settings);
            save(flash, &settings).map_err(UpdateError::Save)
        }
        Ok(Loaded::Missing | Loaded::Corrupt) => Err(UpdateError::Nothing),
        Err(error) => Err(UpdateError::Save(SaveError::Flash(error))),
    }
}

/// Whether `first` comes after `second`, over the wrap of the numbers.
fn later(first: u32, second: u32) -> bool {
    first.wrapping_sub(second).cast_signed() > 0
}

fn slot_start(flash: &impl ReadNorFlash, slot: usize) -> u32 {
    (flash.capacity() / 2 * slot) as u32
}

/// The slot with the later record, and its sequence number.
fn newest(slots: [Slot; 2]) -> Option<(usize, u32)> {
    match slots {
        [Slot::Valid(first), Slot::Valid(second)] if later(first, second) => Some((0, first)),
        [_, Slot::Valid(second)] => Some((1, second)),
        [Slot::Valid(first), _] => Some((0, first)),
        _ => None,
    }
}

/// What is in a slot; `record` is where it is read to.
fn look_into<F: ReadNorFlash>(flash: &mut F, slot: usize, record: &mut Record) -> Result<Slot, F::Error> {
    flash.read(slot_start(flash, slot), record)?;
    if record.iter().all(|&byte| byte == 0xFF) {
        return Ok(Slot::Erased);
    }
    let [_, _, _, _, _, _, _, _, n0, n1, n2, n3, ..] = *record;
    Ok(if check(record).is_some() { Slot::Valid(u32::from_le_bytes([n0, n1, n2, n3])) } else { Slot::Corrupt })
}

/// Writes a record and gives its length; `None` where the settings are too long.
fn encode(settings: &Settings, sequence: u32, record: &mut Record) -> Option<usize> {
    let (header, rest) = record.split_first_chunk_mut::<HEADER>()?;
    let length = postcard::to_slice(settings, rest).ok()?.len();
    let [magic @ .., _, _, _, _, _, _, _, _] = header;
    *magic = MAGIC;
    let [_, _, _, _, v0, v1, l0, l1, number @ ..] = header;
    [*v0, *v1] = VERSION.to_le_bytes();
    [*l0, *l1] = u16::try_from(length).ok()?.to_le_bytes();
    *number = sequence.to_le_bytes();
    let (checked, rest) = record.split_at_mut_checked(HEADER + length)?;
    *rest.first_chunk_mut::<CRC_LENGTH>()? = CRC.checksum(checked).to_le_bytes();
    Some(HEADER + length + CRC_LENGTH)
}

/// The version of a record, and where its settings end; `None` where any of its checks fails.
fn check(record: &Record) -> Option<(u16, usize)> {
    let [m0, m1, m2, m3, v0, v1, l0, l1, ..] = *record;
    let end = HEADER + usize::from(u16::from_le_bytes([l0, l1]));
    let (checked, rest) = record.split_at_checked(end)?;
    let version = u16::from_le_bytes([v0, v1]);
    let sound = [m0, m1, m2, m3] == MAGIC
        && matches!(version, OLD_VERSION | VERSION)
        && CRC.checksum(checked) == u32::from_le_bytes(*rest.first_chunk()?);
    sound.then_some((version, end))
}

/// Settings of a record; `None` where any of its checks fails.
fn decode(record: &Record) -> Option<Settings> {
    let (version, end) = check(record)?;
    decode_version(version, record.get(HEADER..end)?)
}

/// Settings as a record of this version holds them; `None` where the version is not known, or they are none.
pub fn decode_version(version: u16, content: &[u8]) -> Option<Settings> {
    match version {
        OLD_VERSION => read::<Settings4>(content).map(Settings::from),
        VERSION => read(content),
        _ => None,
    }
}

/// Never inlined: the two versions do not need the stack at the same time.
#[inline(never)]
fn read<'a, S: Deserialize<'a>>(content: &'a [u8]) -> Option<S> {
    let mut bytes = postcard::Deserializer::from_bytes(content);
    let settings = S::deserialize(&mut bytes).ok()?;
    bytes.finalize().is_ok_and(<[u8]>::is_empty).then_some(settings)
}

#[cfg(test)]
pub mod longest;
#[cfg(test)]
mod tests;

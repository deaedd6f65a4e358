//! A slot: the image, and what is known of it.
//!
//! The last 256 bytes hold, in words of 32 bits, little-endian:
//!
//! | offset | words | content |
//! |---|---|---|
//! | 0 | 5 | the seal: magic `NFSL`, sequence number, length of the image, its CRC-32, CRC-32 of these four |
//! | 32 | 8 | trials: the loader writes one before each start of an image that is not confirmed |
//! | 64 | 8 | confirmation: the image that works writes it |
//!
//! Words are written once after an erase. A power cut may leave a word that is neither erased nor whole: a seal like that fails its check, a trial
//! like that counts, a confirmation like that does not, and the next of its words is used.

use embedded_storage::nor_flash::NorFlash;

use crate::CRC_32;
use crate::parts;

/// Bytes of a slot that are not the image's.
pub const TRAILER: u32 = 256;
/// Starts that an image has to confirm itself. One that works does so at the first; a person who switches off at once spends one more.
pub const TRIALS: u32 = 3;

const SEAL: u32 = 0;
const TRIAL: u32 = 32;
const CONFIRMATION: u32 = 64;
/// Of trials, and of confirmations.
const MARKS: u32 = 8;
const WORD: usize = 4;
const MAGIC: u32 = u32::from_le_bytes(*b"NFSL");
const CONFIRMED: u32 = u32::from_le_bytes(*b"GOOD");
const TRIED: u32 = 0;
const ERASED: u32 = u32::MAX;

/// What makes an image whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// One more with every update.
    pub sequence: u32,
    /// Bytes of the image.
    pub length: u32,
    pub crc: u32,
}

/// Where a slot's trailer begins.
fn trailer(flash: &impl NorFlash) -> u32 {
    (flash.capacity() as u32).saturating_sub(TRAILER)
}

fn word<F: NorFlash>(flash: &mut F, offset: u32) -> Option<u32> {
    let at = trailer(flash) + offset;
    let mut bytes = [0; WORD];
    flash.read(at, &mut bytes).ok()?;
    Some(u32::from_le_bytes(bytes))
}

/// Writes a word of the trailer; gives whether it holds.
fn put<F: NorFlash>(flash: &mut F, offset: u32, value: u32) -> bool {
    let at = trailer(flash) + offset;
    flash.write(at, &value.to_le_bytes()).is_ok() && word(flash, offset) == Some(value)
}

fn marks() -> impl Iterator<Item = u32> {
    (0..MARKS).map(|number| WORD as u32 * number)
}

impl Seal {
    fn words(&self) -> [u32; 5] {
        let [magic, sequence, length, crc] = [MAGIC, self.sequence, self.length, self.crc];
        let mut digest = CRC_32.digest();
        [magic, sequence, length, crc].iter().for_each(|word| digest.update(&word.to_le_bytes()));
        [magic, sequence, length, crc, digest.finalize()]
    }

    /// The seal of a slot; nothing where it has none, or one that was not finished.
    pub fn read<F: NorFlash>(flash: &mut F) -> Option<Self> {
        let mut words = [0; 5];
        for (place, offset) in words.iter_mut().zip((SEAL..).step_by(WORD)) {
            *place = word(flash, offset)?;
        }
        let [_, sequence, length, crc, _] = words;
        let seal = Self { sequence, length, crc };
        (seal.words() == words && (1..=trailer(flash)).contains(&length)).then_some(seal)
    }

    /// Seals what is in a slot; gives whether it holds. The check comes last.
    pub fn write<F: NorFlash>(&self, flash: &mut F) -> bool {
        self.words().into_iter().zip((SEAL..).step_by(WORD)).all(|(word, offset)| put(flash, offset, word))
    }

    /// Whether the slot holds the image that was sealed.
    pub fn is_whole<F: NorFlash>(&self, flash: &mut F) -> bool {
        content_crc(flash, self.length) == Some(self.crc)
    }
}

/// CRC-32 of a slot's first bytes.
pub fn content_crc<F: NorFlash>(flash: &mut F, length: u32) -> Option<u32> {
    let mut digest = CRC_32.digest();
    parts::each(flash, 0..length, |part| digest.update(part)).ok()?;
    Some(digest.finalize())
}

/// Whether there is nothing of an update in a slot's trailer: its image, if there is one, was brought by a debug probe.
pub fn is_unsealed<F: NorFlash>(flash: &mut F) -> bool {
    (0..TRAILER).step_by(WORD).all(|offset| word(flash, offset) == Some(ERASED))
}

/// How often the image was started without being confirmed.
pub fn trials<F: NorFlash>(flash: &mut F) -> u32 {
    marks().filter(|offset| word(flash, TRIAL + offset) != Some(ERASED)).count() as u32
}

/// Counts a start; gives whether that holds.
pub fn try_once<F: NorFlash>(flash: &mut F) -> bool {
    let unused = marks().find(|offset| word(flash, TRIAL + offset) == Some(ERASED));
    unused.is_some_and(|offset| put(flash, TRIAL + offset, TRIED))
}

pub fn is_confirmed<F: NorFlash>(flash: &mut F) -> bool {
    marks().any(|offset| word(flash, CONFIRMATION + offset) == Some(CONFIRMED))
}

/// Confirms the image: the loader starts it from now on; gives whether that holds.
pub fn confirm<F: NorFlash>(flash: &mut F) -> bool {
    if is_confirmed(flash) {
        return true;
    }
    let unused = marks().find(|offset| word(flash, CONFIRMATION + offset) == Some(ERASED));
    unused.is_some_and(|offset| put(flash, CONFIRMATION + offset, CONFIRMED))
}

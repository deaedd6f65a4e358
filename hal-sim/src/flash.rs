//! NOR flash that is as strict as the real thing: two sectors of 8192 bytes for settings, and behind them one of 64 KiB and one of 128 KiB for a log; words of
//! four bytes that can be written once after an erase. Power can be cut in the middle of an operation.

use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};
use std::fmt;

/// Bytes in a sector for settings.
pub const SECTOR: usize = 8192;
/// Bytes for settings.
pub const CAPACITY: usize = 2 * SECTOR;
/// Bytes of the sectors, in their order.
const SECTORS: [usize; 4] = [SECTOR, SECTOR, 64 << 10, 128 << 10];
/// Bytes in all.
pub const TOTAL: usize = CAPACITY + (192 << 10);
/// Bytes in a word.
pub const WORD: usize = 4;
/// An erase is as long as this many bytes of writing, as far as a power cut is concerned.
pub const ERASE_COST: usize = 8;

/// Why an operation failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlashError {
    /// Offset or length is not a multiple of the word or sector.
    NotAligned,
    /// It would reach beyond the end.
    OutOfBounds,
    /// The word at this offset was written since it was erased.
    WrittenTwice {
        /// Offset of the word.
        offset: u32,
    },
    /// Power failed: the operation is incomplete, and nothing works until power is back.
    PowerLost,
}

impl FlashError {
    /// A number for transports: 1 not aligned, 2 out of bounds, 3 written twice, 4 power lost.
    pub fn code(self) -> u8 {
        match self {
            Self::NotAligned => 1,
            Self::OutOfBounds => 2,
            Self::WrittenTwice { .. } => 3,
            Self::PowerLost => 4,
        }
    }
}

impl fmt::Display for FlashError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAligned => write!(f, "flash: offset or length is not a multiple of the word or sector"),
            Self::OutOfBounds => write!(f, "flash: beyond the end of {TOTAL} bytes"),
            Self::WrittenTwice { offset } => write!(f, "flash: the word at {offset:#x} was already written"),
            Self::PowerLost => write!(f, "flash: power was lost"),
        }
    }
}

impl std::error::Error for FlashError {}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::WrittenTwice { .. } | Self::PowerLost => NorFlashErrorKind::Other,
        }
    }
}

/// The memory.
#[derive(Debug, Clone)]
pub struct FlashMemory {
    bytes: Vec<u8>,
    written: Vec<bool>,
    power_left: Option<usize>,
}

impl FlashMemory {
    /// Erased.
    pub fn erased() -> Self {
        Self { bytes: vec![0xFF; TOTAL], written: vec![false; TOTAL / WORD], power_left: None }
    }

    /// With this content; what an image does not reach is erased, what it has too much is left out.
    pub fn with_contents(image: &[u8]) -> Self {
        let mut memory = Self::erased();
        let length = image.len().min(TOTAL);
        memory.bytes[..length].copy_from_slice(&image[..length]);
        for (written, word) in memory.written.iter_mut().zip(memory.bytes.chunks(WORD)) {
            *written = word.iter().any(|byte| *byte != 0xFF);
        }
        memory
    }

    /// Everything in it.
    pub fn contents(&self) -> &[u8] {
        &self.bytes
    }

    /// Power fails after that many more bytes ([`ERASE_COST`] for an erase of a sector).
    pub fn cut_power_after(&mut self, bytes: usize) {
        self.power_left = Some(bytes);
    }

    /// Power is back and stays.
    pub fn restore_power(&mut self) {
        self.power_left = None;
    }

    /// Reads any bytes.
    pub fn read(&self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        if self.power_left == Some(0) {
            return Err(FlashError::PowerLost);
        }
        let start = range(offset, bytes.len(), 1)?;
        bytes.copy_from_slice(&self.bytes[start..start + bytes.len()]);
        Ok(())
    }

    /// Writes whole words that are erased. A word in which power fails keeps the bytes that were done.
    pub fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let start = range(offset, bytes.len(), WORD)?;
        for (number, &byte) in bytes.iter().enumerate() {
            let at = start + number;
            if at.is_multiple_of(WORD) && self.written[at / WORD] {
                return Err(FlashError::WrittenTwice { offset: at as u32 });
            }
            if self.spend(1) == 0 {
                return Err(FlashError::PowerLost);
            }
            self.written[at / WORD] = true;
            // Programming only takes ones away.
            self.bytes[at] &= byte;
        }
        Ok(())
    }

    /// Erases whole sectors. A sector in which power fails is erased in part.
    pub fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = to.checked_sub(from).ok_or(FlashError::OutOfBounds)? as usize;
        let at = range(from, length, WORD)?;
        let end = at + length;
        let boundaries = SECTORS.iter().scan(0, |end, size| {
            *end += size;
            Some(*end)
        });
        let boundaries: Vec<usize> = std::iter::once(0).chain(boundaries).collect();
        if ![at, end].iter().all(|place| boundaries.contains(place)) {
            return Err(FlashError::NotAligned);
        }
        for sector in boundaries.windows(2).filter(|sector| (at..end).contains(&sector[0])) {
            let (start, size) = (sector[0], sector[1] - sector[0]);
            let done = self.spend(ERASE_COST) * size / ERASE_COST;
            self.bytes[start..start + done].fill(0xFF);
            self.written[start / WORD..(start + done) / WORD].fill(false);
            if done < size {
                return Err(FlashError::PowerLost);
            }
        }
        Ok(())
    }

    /// Uses up to `cost` of the power that is left; gives what was there.
    fn spend(&mut self, cost: usize) -> usize {
        match &mut self.power_left {
            None => cost,
            Some(left) => {
                let used = cost.min(*left);
                *left -= used;
                used
            }
        }
    }
}

fn range(offset: u32, length: usize, unit: usize) -> Result<usize, FlashError> {
    let start = offset as usize;
    if length > TOTAL || start > TOTAL - length {
        Err(FlashError::OutOfBounds)
    } else if !start.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        Err(FlashError::NotAligned)
    } else {
        Ok(start)
    }
}

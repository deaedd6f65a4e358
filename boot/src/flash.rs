//! A slot of the STM32F405's flash, as the loader sees it: read as memory, written by words (RM0090, 3.6 and 3.9).

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use north_boot::{SECTOR_BYTES, SLOT_BYTES};

const KEY: *mut u32 = 0x4002_3C04 as *mut u32;
const STATUS: *mut u32 = 0x4002_3C0C as *mut u32;
const CONTROL: *mut u32 = 0x4002_3C10 as *mut u32;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const BUSY: u32 = 1 << 16;
const ERRORS: u32 = 0xF2;
const WRITE_WORDS: u32 = 2 << 8 | 1;
const LOCK: u32 = 1 << 31;
/// A word takes 16 µs, at most 100: this many looks take longer at 16 MHz.
const LOOKS: u32 = 10_000;

pub struct Slot(u32);

impl Slot {
    pub fn at(origin: u32) -> Self {
        Self(origin)
    }
}

impl ErrorType for Slot {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Slot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        if offset.saturating_add(bytes.len() as u32) > SLOT_BYTES {
            return Err(NorFlashErrorKind::OutOfBounds);
        }
        for (at, byte) in (self.0 + offset..).zip(bytes) {
            // SAFETY: an address in the slot.
            *byte = unsafe { (at as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SLOT_BYTES as usize
    }
}

impl NorFlash for Slot {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    /// The loader erases nothing.
    fn erase(&mut self, _: u32, _: u32) -> Result<(), NorFlashErrorKind> {
        Err(NorFlashErrorKind::Other)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        if offset.saturating_add(bytes.len() as u32) > SLOT_BYTES || !offset.is_multiple_of(4) {
            return Err(NorFlashErrorKind::OutOfBounds);
        }
        let mut result = Ok(());
        // SAFETY: the flash's controller by its manual, here and below; words of the slot.
        unsafe {
            KEYS.iter().for_each(|&key| KEY.write_volatile(key));
            STATUS.write_volatile(ERRORS);
            CONTROL.write_volatile(WRITE_WORDS);
        }
        for (at, word) in (self.0 + offset..).step_by(4).zip(bytes.as_chunks::<4>().0) {
            let idle = unsafe {
                (at as *mut u32).write_volatile(u32::from_le_bytes(*word));
                (0..LOOKS).any(|_| STATUS.read_volatile() & BUSY == 0)
            };
            if !idle || unsafe { STATUS.read_volatile() } & ERRORS != 0 {
                result = Err(NorFlashErrorKind::Other);
            }
        }
        unsafe { CONTROL.write_volatile(LOCK) };
        result
    }
}

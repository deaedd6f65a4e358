//! The flash memory for the settings: sectors 1 and 2, 16 KiB each, between the vectors in sector 0 and the program.
//!
//! While a sector is erased, for a quarter of a second, the processor stands still: it runs from the same flash. Writing is
//! by words of 32 bits, some 16 µs each.

use embedded_storage::nor_flash::{self, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use stm32f4xx_hal::pac;

const SECTOR: usize = 16 * 1024;
const FIRST_SECTOR: u8 = 1;
const SECTORS: usize = 2;
const WORD: usize = 4;
const START: usize = 0x0800_0000 + SECTOR;
/// Erasing takes at most half a second; this many looks at the busy flag take longer at any clock.
const LOOKS: u32 = 100_000_000;

pub struct Flash(pac::FLASH);

/// What the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum FlashError {
    /// Outside the settings' sectors, or not by whole words or sectors.
    Place,
    /// The controller's error bits, or its busy flag stays.
    Controller { status: u32 },
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place => NorFlashErrorKind::OutOfBounds,
            Self::Controller { .. } => NorFlashErrorKind::Other,
        }
    }
}

impl Flash {
    pub fn new(registers: pac::FLASH) -> Self {
        Self(registers)
    }

    /// Sets the brown-out level to 3, about 2.8 V (RM0090, 3.9.10), where it is not: option bytes, written once in a chip's life.
    pub fn set_brown_out_level(&mut self) -> Result<(), FlashError> {
        const KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];
        // The manual counts from 0 for level 3 to 3 for none; the names that the register's description has count the other way.
        const LEVEL_3: u8 = 0;
        let control = self.0.optcr();
        if control.read().bor_lev().bits() == LEVEL_3 {
            return Ok(());
        }
        for key in KEYS {
            self.0.optkeyr().write(|w| w.optkeyr().set(key));
        }
        done(&self.0)?;
        control.modify(|_, w| w.bor_lev().set(LEVEL_3));
        control.modify(|_, w| w.optstrt().set_bit());
        let result = done(&self.0);
        control.modify(|_, w| w.optlock().set_bit());
        result
    }

    /// Erases a sector: the settings', or one of a slot that does not run.
    pub(super) fn erase_sector(&mut self, number: u8) -> Result<(), FlashError> {
        self.unlocked(|registers| {
            // SAFETY: a sector of which nothing is executed. What is written begins with the value after a reset, which locks; so below.
            registers
                .cr()
                .write(|w| unsafe { w.lock().clear_bit().psize().psize32().ser().set_bit().snb().bits(number) });
            registers.cr().modify(|_, w| w.strt().set_bit());
            done(registers)
        })
    }

    /// Writes whole words from this address on, in such a sector.
    pub(super) fn write_words(&mut self, start: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.unlocked(|registers| {
            registers.cr().write(|w| w.lock().clear_bit().psize().psize32().pg().set_bit());
            let words = bytes.as_chunks::<WORD>().0;
            for (at, word) in (start..).step_by(WORD).zip(words) {
                // SAFETY: a word in a sector of which nothing is executed; the controller is set to write words.
                unsafe { (at as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
                done(registers)?;
            }
            Ok(())
        })
    }

    /// Does what needs the controller unlocked; locks it whatever happens, and empties the cache of flash data, which does not
    /// see erasing and writing.
    fn unlocked(&mut self, work: impl FnOnce(&pac::FLASH) -> Result<(), FlashError>) -> Result<(), FlashError> {
        const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
        for key in KEYS {
            self.0.keyr().write(|w| w.key().set(key));
        }
        let result = work(&self.0);
        self.0.cr().write(|w| w.lock().set_bit());
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
        result
    }
}

/// Waits until the controller is idle.
fn done(registers: &pac::FLASH) -> Result<(), FlashError> {
    const ERRORS: u32 = 0xF2;
    let idle = (0..LOOKS).any(|_| registers.sr().read().bsy().bit_is_clear());
    let status = registers.sr().read().bits();
    if idle && status & ERRORS == 0 { Ok(()) } else { Err(FlashError::Controller { status }) }
}

/// Whether a place lies in the settings' sectors, in whole units.
fn fits(from: usize, to: usize, unit: usize) -> Result<(), FlashError> {
    let whole = from.is_multiple_of(unit) && to.is_multiple_of(unit);
    if whole && from <= to && to <= SECTORS * SECTOR { Ok(()) } else { Err(FlashError::Place) }
}

impl nor_flash::ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    /// Flash is read as memory.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let from = offset as usize;
        fits(from, from + bytes.len(), 1)?;
        for (at, byte) in (START + from..).zip(bytes) {
            // SAFETY: an address in the settings' sectors, which nothing else uses.
            *byte = unsafe { (at as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SECTORS * SECTOR
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        fits(from as usize, to as usize, SECTOR)?;
        (from as usize / SECTOR..to as usize / SECTOR)
            .try_for_each(|sector| self.erase_sector(FIRST_SECTOR + sector as u8))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let from = offset as usize;
        fits(from, from + bytes.len(), WORD)?;
        self.write_words((START + from) as u32, bytes)
    }
}

//! The flash memory for the settings, sectors 1 and 2 of 16 KiB each, and, behind them, for the log: sector 4 of 64 and sector 11 of 128 KiB.
//!
//! While a sector is erased, for a quarter of a second to two seconds, the processor stands still: it runs from the same flash. Writing is
//! by words of 32 bits, some 16 µs each.

use embedded_storage::nor_flash::{self, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use north_finder::event::service::flash::LOG_SECTORS;
use stm32f4xx_hal::pac;

use super::feed_watchdog;

/// A sector that the firmware writes.
struct Sector {
    number: u8,
    address: usize,
    /// Where it begins among the others, and its bytes.
    offset: usize,
    length: usize,
}

/// Those of the settings, then those of the log (RM0090, table 5).
static SECTORS: [Sector; 4] = [
    Sector { number: 1, address: 0x0800_4000, offset: 0, length: SETTINGS_SECTOR },
    Sector { number: 2, address: 0x0800_8000, offset: SETTINGS_SECTOR, length: SETTINGS_SECTOR },
    Sector { number: 4, address: 0x0801_0000, offset: 2 * SETTINGS_SECTOR, length: LOG_SECTORS[0] as usize },
    Sector {
        number: 11,
        address: 0x080E_0000,
        offset: 2 * SETTINGS_SECTOR + LOG_SECTORS[0] as usize,
        length: LOG_SECTORS[1] as usize,
    },
];
const SETTINGS_SECTOR: usize = 16 * 1024;
const WORD: usize = 4;
/// Erasing takes at most two seconds; this many looks at the busy flag take longer at any clock.
const LOOKS: u32 = 100_000_000;

pub struct Flash(pac::FLASH);

/// What the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum FlashError {
    /// Outside the sectors, over the end of one, or not by whole words or sectors.
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
    ///
    /// The processor stands still meanwhile, for a second or two where the sector has 128 KiB: the watchdog is fed before and after.
    pub(super) fn erase_sector(&mut self, number: u8) -> Result<(), FlashError> {
        feed_watchdog();
        let erased = self.unlocked(|registers| {
            // SAFETY: a sector of which nothing is executed. What is written begins with the value after a reset, which locks; so below.
            registers
                .cr()
                .write(|w| unsafe { w.lock().clear_bit().psize().psize32().ser().set_bit().snb().bits(number) });
            registers.cr().modify(|_, w| w.strt().set_bit());
            done(registers)
        });
        feed_watchdog();
        erased
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
        // What went wrong before is no failure of this.
        // SAFETY: writing ones clears the flags.
        self.0.sr().write(|w| unsafe { w.bits(ERRORS) });
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

/// Of the status: what went wrong. A flag stays until it is written (RM0090, 3.9.7).
const ERRORS: u32 = 0xF2;

/// Waits until the controller is idle.
fn done(registers: &pac::FLASH) -> Result<(), FlashError> {
    let idle = (0..LOOKS).any(|_| registers.sr().read().bsy().bit_is_clear());
    let status = registers.sr().read().bits();
    if idle && status & ERRORS == 0 { Ok(()) } else { Err(FlashError::Controller { status }) }
}

/// Those that the chip has: an STM32F446 has half of the memory, and no room for a log.
fn sectors() -> &'static [Sector] {
    let count = if cfg!(feature = "nucleo-f446") { 2 } else { SECTORS.len() };
    SECTORS.get(..count).unwrap_or_default()
}

/// Where a place is in memory: in whole units, and in one sector.
fn address(offset: u32, length: usize, unit: usize) -> Result<usize, FlashError> {
    let from = offset as usize;
    let within = |sector: &&Sector| (sector.offset..sector.offset + sector.length).contains(&from);
    let sector = sectors().iter().find(within).ok_or(FlashError::Place)?;
    let whole = from.is_multiple_of(unit) && length.is_multiple_of(unit);
    let fits = whole && length <= sector.offset + sector.length - from;
    if fits { Ok(sector.address + from - sector.offset) } else { Err(FlashError::Place) }
}

impl nor_flash::ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    /// Flash is read as memory.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let start = address(offset, bytes.len(), 1)?;
        for (at, byte) in (start..).zip(bytes) {
            // SAFETY: an address in one of the sectors, which nothing else uses.
            *byte = unsafe { (at as *const u8).read_volatile() };
        }
        Ok(())
    }

    /// Of the settings: the log lies behind them.
    fn capacity(&self) -> usize {
        2 * SETTINGS_SECTOR
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SETTINGS_SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let [from, to] = [from, to].map(|place| place as usize);
        let begins = |place: usize| sectors().iter().any(|sector| sector.offset == place);
        let ends = |place: usize| sectors().iter().any(|sector| sector.offset + sector.length == place);
        if !(begins(from) && ends(to) && from < to) {
            return Err(FlashError::Place);
        }
        let erased = sectors().iter().filter(|sector| (from..to).contains(&sector.offset));
        erased.map(|sector| sector.number).try_for_each(|number| self.erase_sector(number))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let start = address(offset, bytes.len(), WORD)?;
        self.write_words(start as u32, bytes)
    }
}

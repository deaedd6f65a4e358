//! The slots of an update: sectors 5 to 7 and 8 to 10 of the flash, 384 KiB each. See [`north_boot`].

use cortex_m::peripheral::SCB;
use cortex_m::singleton;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use north_boot::{SECTOR_BYTES, SLOT_BYTES, SLOTS};
use north_finder::instrument::update::{Slots, Updater, key};
use stm32f4xx_hal::pac;

use super::BOARD;
use super::flash::{Flash, FlashError};

const FIRST_SECTORS: [u8; 2] = [5, 8];
/// What both slots take. A smaller chip has one image, at the flash's start.
const LEAST_FLASH_KIB: u16 = 1024;
const FLASH_KIB: *const u16 = 0x1FFF_7A22 as *const u16;

/// A slot, by its number.
struct Slot {
    flash: Flash,
    number: usize,
}

impl Slot {
    fn new(number: usize) -> Self {
        // SAFETY: the controller is used by one task at a time, the one that has the settings' flash, too.
        Self { flash: Flash::new(unsafe { pac::Peripherals::steal().FLASH }), number }
    }

    fn origin(&self) -> u32 {
        SLOTS.get(self.number).copied().unwrap_or_default()
    }
}

/// The slots, where this image was started in one of them. Once.
pub fn slots() -> Option<&'static mut dyn Slots> {
    // SAFETY: reading has no effect.
    let (vectors, flash_kib) = unsafe { ((*SCB::PTR).vtor.read(), FLASH_KIB.read_volatile()) };
    let running = SLOTS.iter().position(|&origin| origin == vectors).filter(|_| flash_kib >= LEAST_FLASH_KIB)?;
    let (running, free) = (Slot::new(running), Slot::new(1 - running));
    let origin = free.origin();
    let updater = singleton!(: Updater<Slot> = Updater::new(BOARD, running, free, origin, key()))?;
    Some(updater)
}

impl ErrorType for Slot {
    type Error = FlashError;
}

impl ReadNorFlash for Slot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        if offset.saturating_add(bytes.len() as u32) > SLOT_BYTES {
            return Err(FlashError::Place);
        }
        for (at, byte) in (self.origin() + offset..).zip(bytes) {
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

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        if to > SLOT_BYTES || !from.is_multiple_of(SECTOR_BYTES) || !to.is_multiple_of(SECTOR_BYTES) {
            return Err(FlashError::Place);
        }
        let first = FIRST_SECTORS.get(self.number).copied().ok_or(FlashError::Place)?;
        for sector in from / SECTOR_BYTES..to / SECTOR_BYTES {
            self.flash.erase_sector(first + sector as u8)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        if offset.saturating_add(bytes.len() as u32) > SLOT_BYTES
            || !offset.is_multiple_of(4)
            || !bytes.len().is_multiple_of(4)
        {
            return Err(FlashError::Place);
        }
        let start = self.origin() + offset;
        self.flash.write_words(start, bytes)
    }
}

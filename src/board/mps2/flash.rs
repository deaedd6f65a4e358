//! The flash memory, by the exchange.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::with;

/// The flash memory: two sectors of 8192 bytes for settings, behind them the log's, words of four bytes.
pub struct Flash;

/// The simulated flash refused; its error number.
#[derive(Clone, Copy, Debug, defmt::Format)]
pub struct FlashError(u8);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let length = (bytes.len() as u16).to_le_bytes();
        with(|state| bytes.copy_from_slice(state.exchange.ask(b'R', &[&offset.to_le_bytes(), &length])));
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * Self::ERASE_SIZE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 8192;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        with(|state| flash_result(state.exchange.ask(b'E', &[&from.to_le_bytes(), &to.to_le_bytes()])))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        with(|state| flash_result(state.exchange.ask(b'W', &[&offset.to_le_bytes(), bytes])))
    }
}

fn flash_result(reply: &[u8]) -> Result<(), FlashError> {
    match *reply {
        [0] => Ok(()),
        [error] => Err(FlashError(error)),
        _ => super::end::broken("the host's answer to a flash operation is not a byte"),
    }
}

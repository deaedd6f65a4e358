//! The flash that the firmware writes: the sectors of the settings, which are all of its capacity, and behind them those of the log.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Bytes of the sectors of the log: sectors 4 and 11 of an STM32F405.
pub const LOG_SECTORS: [u32; 2] = [64 * 1024, 128 * 1024];

/// The log's sectors as a flash by themselves.
#[derive(Debug)]
pub struct LogFlash<'a, F>(pub &'a mut F);

impl<F: ReadNorFlash> LogFlash<'_, F> {
    fn start(&self) -> u32 {
        self.0.capacity() as u32
    }
}

impl<F: ErrorType> ErrorType for LogFlash<'_, F> {
    type Error = F::Error;
}

impl<F: ReadNorFlash> ReadNorFlash for LogFlash<'_, F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.0.read(self.start() + offset, bytes)
    }

    fn capacity(&self) -> usize {
        LOG_SECTORS.iter().sum::<u32>() as usize
    }
}

impl<F: NorFlash> NorFlash for LogFlash<'_, F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        let start = self.start();
        self.0.erase(start + from, start + to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.0.write(self.start() + offset, bytes)
    }
}

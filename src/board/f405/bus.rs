//! SPI buses whose select lines rise only when the last bit is over.

use embedded_hal::spi::{ErrorType, SpiBus};
use stm32f4xx_hal::spi::{Error, Instance, Spi};

/// The last byte is received half a clock before its end, 0.8 µs at the slowest: this many looks take longer.
const LOOKS: u32 = 100;

/// A bus that ends its transactions: the HAL's [`SpiBus::flush`] does not wait.
pub struct Ending<SPI: Instance>(pub Spi<SPI>);

impl<SPI: Instance> ErrorType for Ending<SPI> {
    type Error = Error;
}

impl<SPI: Instance> SpiBus for Ending<SPI> {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Error> {
        self.0.read(words)
    }

    fn write(&mut self, words: &[u8]) -> Result<(), Error> {
        self.0.write(words)
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Error> {
        self.0.transfer(read, write)
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Error> {
        self.0.transfer_in_place(words)
    }

    fn flush(&mut self) -> Result<(), Error> {
        // A bus that stays busy is told by what comes back on it.
        let _ = (0..LOOKS).any(|_| !self.0.is_busy());
        Ok(())
    }
}

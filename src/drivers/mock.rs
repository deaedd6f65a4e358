//! An SPI device for the drivers' tests that expects given transactions.

extern crate std;

use std::collections::VecDeque;
use std::convert::Infallible;
use std::{vec, vec::Vec};

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// One transaction: what the driver must send, and what it gets. Reads send 0x00.
#[derive(Debug)]
pub struct Exchange {
    mosi: Vec<u8>,
    miso: Vec<u8>,
}

impl Exchange {
    pub fn new(mosi: impl Into<Vec<u8>>, miso: impl Into<Vec<u8>>) -> Self {
        let (mosi, miso) = (mosi.into(), miso.into());
        assert_eq!(mosi.len(), miso.len());
        Self { mosi, miso }
    }

    /// Inverts the last bit that the driver gets.
    pub fn damage(&mut self) {
        if let Some(byte) = self.miso.last_mut() {
            *byte ^= 1;
        }
    }
}

#[derive(Debug)]
pub struct MockSpi(VecDeque<Exchange>);

impl MockSpi {
    pub fn new(exchanges: Vec<Exchange>) -> Self {
        Self(exchanges.into())
    }

    /// The transactions that find an ADXL355 and configure it to measure.
    pub fn adxl355_configuration() -> Vec<Exchange> {
        Self::adxl355_configured(0x81, 0x00)
    }

    /// The same with these contents of RANGE and SELF_TEST: by hand from the data sheet, address · 2, + 1 to read.
    pub fn adxl355_configured(range: u8, test: u8) -> Vec<Exchange> {
        vec![
            Exchange::new([0x01, 0, 0, 0], [0, 0xAD, 0x1D, 0xED]),
            Exchange::new([0x5A, 0x01], [0, 0]),
            Exchange::new([0x5B, 0], [0, 0x01]),
            Exchange::new([0x50, 0x05], [0, 0]),
            Exchange::new([0x51, 0], [0, 0x05]),
            Exchange::new([0x58, range], [0, 0]),
            Exchange::new([0x59, 0], [0, range]),
            Exchange::new([0x5C, test], [0, 0]),
            Exchange::new([0x5D, 0], [0, test]),
            Exchange::new([0x5A, 0x00], [0, 0]),
            Exchange::new([0x5B, 0], [0, 0x00]),
        ]
    }

    /// All expected transactions have been made.
    pub fn done(&self) {
        assert!(self.0.is_empty(), "transactions that were not made: {:?}", self.0);
    }
}

impl ErrorType for MockSpi {
    type Error = Infallible;
}

impl SpiDevice for MockSpi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let expected = self.0.pop_front().expect("a transaction that was not expected");
        let (mut sent, mut received) = (Vec::new(), expected.miso.iter().copied());
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    sent.extend_from_slice(bytes);
                    received.by_ref().take(bytes.len()).for_each(drop);
                }
                Operation::Read(bytes) => {
                    sent.extend(bytes.iter().map(|_| 0));
                    bytes.iter_mut().zip(received.by_ref()).for_each(|(byte, value)| *byte = value);
                }
                Operation::TransferInPlace(bytes) => {
                    sent.extend_from_slice(bytes);
                    bytes.iter_mut().zip(received.by_ref()).for_each(|(byte, value)| *byte = value);
                }
                Operation::DelayNs(_) => {}
                Operation::Transfer(..) => panic!("not used by these drivers"),
            }
        }
        assert_eq!(sent, expected.mosi);
        Ok(())
    }
}

//! The simulated devices, as the chips and lines that the emulator hangs on its buses.

use std::collections::VecDeque;
use std::fmt::Debug;

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, BlockSpi, EncoderSpi, GyroLine};
use rigless::chip::{Timeline, spi, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// A simulated device on an SPI bus.
pub trait Device: Debug + Send + 'static {
    /// What comes back with the last of these bytes, in a transaction that is under way.
    fn answer(&mut self, mosi: &[u8]) -> u8;
    /// The transaction, from its beginning to its end.
    fn exchange(&mut self, mosi: &[u8]);
}

macro_rules! device {
    ($handle:ty) => {
        impl Device for $handle {
            fn answer(&mut self, mosi: &[u8]) -> u8 {
                self.answer(mosi)
            }

            fn exchange(&mut self, mosi: &[u8]) {
                self.exchange(mosi);
            }
        }
    };
}

device!(AccelerometerSpi);
device!(EncoderSpi);
device!(BlockSpi);

/// A device behind its select line, byte by byte.
#[derive(Debug)]
pub struct Slave<D> {
    device: D,
    mosi: Vec<u8>,
}

impl<D> Slave<D> {
    pub fn new(device: D) -> Self {
        Self { device, mosi: Vec::new() }
    }
}

impl<D> Store for Slave<D> {}

impl<D: Device> spi::Peer for Slave<D> {
    fn transfer(&mut self, mosi: u32, bits: u8, _: &mut Timeline<'_, '_>) -> u32 {
        assert_eq!(bits, 8, "the drivers work by bytes");
        self.mosi.push(mosi as u8);
        self.device.answer(&self.mosi).into()
    }

    fn deselect(&mut self, _: &mut Timeline<'_, '_>) {
        if !self.mosi.is_empty() {
            self.device.exchange(&self.mosi);
            self.mosi.clear();
        }
    }
}

/// The gyro's transmitter.
#[derive(Debug)]
pub struct GyroOutput(pub GyroLine);

impl Store for GyroOutput {}

impl uart::Peer for GyroOutput {
    fn receive(&mut self, _: u16, _: &mut Timeline<'_, '_>) {}

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        let mut byte = [0];
        let Ok(count) = self.0.read(&mut byte);
        (count == 1).then(|| byte[0].into())
    }
}

/// The host's end of its line.
#[derive(Debug, Default)]
pub struct HostLine {
    pub to_send: VecDeque<u8>,
    pub sent: Vec<u8>,
}

impl Store for HostLine {}

impl uart::Peer for HostLine {
    fn receive(&mut self, word: u16, _: &mut Timeline<'_, '_>) {
        self.sent.push(word as u8);
    }

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        self.to_send.pop_front().map(u16::from)
    }
}

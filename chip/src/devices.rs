//! The simulated devices, as the chips and lines that the emulator hangs on its buses.

use std::collections::VecDeque;
use std::fmt::Debug;

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, BlockSpi, EncoderSpi, GyroLine};
use rigless::chip::{Timeline, spi, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

use crate::parts::Part;
use crate::witness::Ledger;

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

/// A device behind its select line, byte by byte, with its registers as the data sheet describes them.
#[derive(Debug)]
pub struct Slave<D, P> {
    device: D,
    part: P,
    /// From when on it is there, ns: before, the bus's pull-up answers.
    from_ns: u64,
    ledger: Ledger,
    mosi: Vec<u8>,
}

impl<D, P> Slave<D, P> {
    pub fn new(device: D, part: P, from_ns: u64, ledger: &Ledger) -> Self {
        Self { device, part, from_ns, ledger: ledger.clone(), mosi: Vec::new() }
    }
}

impl<D, P> Store for Slave<D, P> {}

impl<D: Device, P: Part> spi::Peer for Slave<D, P> {
    fn transfer(&mut self, mosi: u32, _: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let at_ns = context.now().0;
        if at_ns < self.from_ns {
            return 0xFF;
        }
        self.mosi.push(mosi as u8);
        let world = self.device.answer(&self.mosi);
        self.part.answer(&self.mosi, world, at_ns, &self.ledger).into()
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        if !self.mosi.is_empty() {
            self.device.exchange(&self.mosi);
            self.part.end(&self.mosi, context.now().0, &self.ledger);
            self.mosi.clear();
        }
    }
}

/// The gyro's end of its line.
#[derive(Debug)]
pub struct GyroOutput(pub GyroLine);

impl Store for GyroOutput {}

impl uart::Peer for GyroOutput {
    fn receive(&mut self, word: u16, _: &mut Timeline<'_, '_>) {
        self.0.send(word as u8);
    }

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

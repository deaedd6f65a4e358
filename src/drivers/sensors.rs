//! Which sensor is read at which tick: one schedule for the board, QEMU and the in-process run.

use super::adis16505::{Adis16505, Increments};
use super::adxl355::Adxl355;
use super::as5048a::As5048a;
use crate::codes::{IndexCode, TriadCode};
use embedded_hal::spi::SpiDevice;

/// Every sensor is read at every fourth tick (100 Hz), no two of them at one.
const PERIOD_TICKS: u64 = 4;
const ACCELEROMETER_PHASE: u64 = 0;
const BLOCK_PHASE: u64 = 1;
const ENCODER_PHASE: u64 = 2;

/// The accelerometer, the encoder and, where there is one, the block of three gyros. `A`, `E` and `B` are their SPI devices.
#[derive(Debug)]
pub struct Sensors<A, E, B> {
    accelerometer: Adxl355<A>,
    encoder: As5048a<E>,
    block: Option<Adis16505<B>>,
    accelerometer_configured: bool,
}

/// What a tick's turn gave: one sensor's reading, `None` if it gave nothing valid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Due {
    #[default]
    Nothing,
    Acceleration(Option<TriadCode>),
    Index(Option<IndexCode>),
    /// What the block summed up since its last reading.
    Block(Option<Increments>),
}

impl<A: SpiDevice, E: SpiDevice, B: SpiDevice> Sensors<A, E, B> {
    /// Touches no bus: a part that is still starting gets its time.
    pub fn new(accelerometer: A, encoder: E, block: Option<B>) -> Self {
        Self {
            accelerometer: Adxl355::new(accelerometer),
            encoder: As5048a::new(encoder),
            block: block.map(Adis16505::new),
            accelerometer_configured: false,
        }
    }

    /// Reads what is due at the tick of this number.
    pub fn read(&mut self, tick: u64) -> Due {
        match tick % PERIOD_TICKS {
            ACCELEROMETER_PHASE => self.acceleration(),
            BLOCK_PHASE => self.block(),
            ENCODER_PHASE => Due::Index(self.encoder.angle().ok()),
            _ => Due::Nothing,
        }
    }

    /// The turn that configures it has no reading to give.
    fn block(&mut self) -> Due {
        match self.block.as_mut().map(Adis16505::increments) {
            Some(Ok(Some(increments))) => Due::Block(Some(increments)),
            Some(Err(_)) => Due::Block(None),
            None | Some(Ok(None)) => Due::Nothing,
        }
    }

    /// An accelerometer that fails is configured anew at its next turn: it may have lost its supply. The turn that
    /// configures it has no reading to give.
    fn acceleration(&mut self) -> Due {
        let due = if self.accelerometer_configured {
            Due::Acceleration(self.accelerometer.acceleration().ok())
        } else {
            self.accelerometer.configure().map_or(Due::Acceleration(None), |()| Due::Nothing)
        };
        self.accelerometer_configured = due != Due::Acceleration(None);
        due
    }
}

#[cfg(test)]
mod tests {
    use super::super::mock::{Exchange, MockSpi};
    use super::*;
    extern crate std;
    use std::{vec, vec::Vec};

    fn encoder() -> MockSpi {
        MockSpi::new(vec![
            Exchange::new([0x7F, 0xFD], [0, 0]),
            Exchange::new([0xFF, 0xFF], [0x01, 0x80]),
            Exchange::new([0x7F, 0xFD], [0x90, 0x00]),
        ])
    }

    fn accelerometer() -> MockSpi {
        let mut exchanges = MockSpi::adxl355_configuration();
        exchanges.push(Exchange::new(
            [0x09, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
            [0, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3E, 0x80, 0],
        ));
        MockSpi::new(exchanges)
    }

    #[test]
    fn each_sensor_has_its_ticks() {
        let mut sensors = Sensors::new(accelerometer(), encoder(), None::<MockSpi>);
        let due: Vec<Due> = (0..5).map(|tick| sensors.read(tick)).collect();
        let angle = Due::Index(Some(IndexCode(1 << 30)));
        let acceleration = Due::Acceleration(Some(TriadCode([0, 0, 256_000 << 12])));
        assert_eq!(due, [Due::Nothing, Due::Nothing, angle, Due::Nothing, acceleration]);
    }

    #[test]
    fn a_failed_sensor_is_told_from_one_that_is_not_due() {
        let wrong_part = vec![Exchange::new([0x01, 0, 0, 0], [0, 0, 0, 0])];
        let odd_parity = vec![Exchange::new([0x7F, 0xFD], [0, 0]), Exchange::new([0xFF, 0xFF], [0x10, 0x00])];
        let no_block = vec![Exchange::new([0x72, 0], [0, 0]), Exchange::new([0, 0], [0xFF, 0xFF])];
        let mut sensors =
            Sensors::new(MockSpi::new(wrong_part), MockSpi::new(odd_parity), Some(MockSpi::new(no_block)));
        let due: Vec<Due> = (0..3).map(|tick| sensors.read(tick)).collect();
        assert_eq!(due, [Due::Acceleration(None), Due::Block(None), Due::Index(None)]);
    }

    #[test]
    fn a_failed_accelerometer_is_configured_anew() {
        let mut exchanges = vec![Exchange::new([0x01, 0, 0, 0], [0, 0, 0, 0])];
        exchanges.extend(MockSpi::adxl355_configuration());
        let mut sensors = Sensors::new(MockSpi::new(exchanges), MockSpi::new(vec![]), None::<MockSpi>);
        assert_eq!([sensors.read(0), sensors.read(4)], [Due::Acceleration(None), Due::Nothing]);
    }
}

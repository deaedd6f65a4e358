//! Which sensor is read at which tick: one schedule for the board, QEMU and the in-process run.

use embedded_hal::spi::SpiDevice;
use serde::{Deserialize, Serialize};

use super::adis16505::{Adis16505, Increments};
use super::adxl355::Adxl355;
use super::as5048a::As5048a;
use crate::codes::{IndexCode, TriadCode};
use crate::reading::Reading;

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

/// What one tick's readings gave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Due {
    pub acceleration: Reading<TriadCode>,
    pub index: Reading<IndexCode>,
    /// What the block summed up since its last reading.
    pub block: Reading<Increments>,
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
            ACCELEROMETER_PHASE => Due { acceleration: self.acceleration(), ..Due::default() },
            BLOCK_PHASE => Due { block: self.block(), ..Due::default() },
            ENCODER_PHASE => Due { index: self.encoder.angle().into(), ..Due::default() },
            _ => Due::default(),
        }
    }

    /// The turn that configures it has no reading to give.
    fn block(&mut self) -> Reading<Increments> {
        match self.block.as_mut().map(Adis16505::increments) {
            Some(Ok(Some(increments))) => Reading::Value(increments),
            Some(Err(_)) => Reading::Failed,
            None | Some(Ok(None)) => Reading::NotDue,
        }
    }

    /// An accelerometer that fails is configured anew at its next turn: it may have lost its supply. The turn that
    /// configures it has no reading to give.
    fn acceleration(&mut self) -> Reading<TriadCode> {
        let reading = if self.accelerometer_configured {
            self.accelerometer.acceleration().into()
        } else {
            self.accelerometer.configure().map_or(Reading::Failed, |()| Reading::NotDue)
        };
        self.accelerometer_configured = reading != Reading::Failed;
        reading
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
        let nothing = Due::default();
        let angle = Due { index: Reading::Value(IndexCode(1 << 30)), ..nothing };
        let acceleration = Due { acceleration: Reading::Value(TriadCode([0, 0, 256_000 << 12])), ..nothing };
        assert_eq!(due, [nothing, nothing, angle, nothing, acceleration]);
    }

    #[test]
    fn a_failed_sensor_is_told_from_one_that_is_not_due() {
        let wrong_part = vec![Exchange::new([0x01, 0, 0, 0], [0, 0, 0, 0])];
        let odd_parity = vec![Exchange::new([0x7F, 0xFD], [0, 0]), Exchange::new([0xFF, 0xFF], [0x10, 0x00])];
        let no_block = vec![Exchange::new([0x72, 0], [0, 0]), Exchange::new([0, 0], [0xFF, 0xFF])];
        let mut sensors =
            Sensors::new(MockSpi::new(wrong_part), MockSpi::new(odd_parity), Some(MockSpi::new(no_block)));
        assert_eq!(sensors.read(0).acceleration, Reading::Failed);
        assert_eq!(sensors.read(1).block, Reading::Failed);
        assert_eq!(sensors.read(2).index, Reading::Failed);
    }

    #[test]
    fn a_failed_accelerometer_is_configured_anew() {
        let mut exchanges = vec![Exchange::new([0x01, 0, 0, 0], [0, 0, 0, 0])];
        exchanges.extend(MockSpi::adxl355_configuration());
        let mut sensors = Sensors::new(MockSpi::new(exchanges), MockSpi::new(vec![]), None::<MockSpi>);
        assert_eq!(sensors.read(0).acceleration, Reading::Failed);
        assert_eq!(sensors.read(4).acceleration, Reading::NotDue);
    }
}

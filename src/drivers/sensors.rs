//! Which sensor is read at which tick: one schedule for the board, QEMU and the in-process run.

use embedded_hal::spi::SpiDevice;
use quantities::codes::{IndexCode, TriadCode};

use super::adis16505::{Adis16505, Increments};
use super::adxl355::{Adxl355, Error, Measurement, Mode};
use super::as5048a::As5048a;

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
    block_was_read: bool,
    response: Option<Response>,
}

/// What a tick's turn gave: one sensor's reading, `None` if it gave nothing valid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Due {
    #[default]
    Nothing,
    Acceleration(Option<Measurement>),
    /// By how much the accelerometer's own test force moved it: a difference of two readings, 2³¹ counts are 16.384 g.
    Response(TriadCode),
    Index(Option<IndexCode>),
    /// What the block summed up since its last reading.
    Block(Option<Increments>),
}

/// The accelerometer's own test under way: its turns since it began, and the sum of its readings under the force minus those without.
#[derive(Debug, Default)]
struct Response {
    turns: u8,
    sum: [i32; 3],
}

/// Readings that are summed, and those before them that the low pass needs to settle: 80 ms.
const SUMMED: u8 = 16;
const SETTLING: u8 = 8;

impl<A: SpiDevice, E: SpiDevice, B: SpiDevice> Sensors<A, E, B> {
    /// Touches no bus: a part that is still starting gets its time.
    pub fn new(accelerometer: A, encoder: E, block: Option<B>) -> Self {
        Self {
            accelerometer: Adxl355::new(accelerometer),
            encoder: As5048a::new(encoder),
            block: block.map(Adis16505::new),
            accelerometer_configured: false,
            block_was_read: false,
            response: None,
        }
    }

    /// Begins the accelerometer's own test: for half a second it gives no readings, and then its [`Due::Response`].
    pub fn test_accelerometer(&mut self) {
        self.response = Some(Response::default());
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

    /// A turn that configures it has no reading to give: the first ones wait for none, later ones lose one.
    fn block(&mut self) -> Due {
        let due = match self.block.as_mut().map(Adis16505::increments) {
            Some(Ok(Some(increments))) => Due::Block(Some(increments)),
            Some(Err(_)) => Due::Block(None),
            Some(Ok(None)) if self.block_was_read => Due::Block(None),
            None | Some(Ok(None)) => Due::Nothing,
        };
        self.block_was_read |= matches!(due, Due::Block(Some(_)));
        due
    }

    /// An accelerometer that fails is configured anew at its next turn: it may have lost its supply. The turn that
    /// configures it has no reading to give.
    fn acceleration(&mut self) -> Due {
        let due = if let Some(response) = &mut self.response {
            let due = response.turn(&mut self.accelerometer).unwrap_or(Due::Acceleration(None));
            // What ends it has configured the part to measure, or not.
            self.response.take_if(|_| due != Due::Nothing);
            due
        } else if self.accelerometer_configured {
            Due::Acceleration(self.accelerometer.measurement().ok())
        } else {
            self.accelerometer.configure(Mode::Measure).map_or(Due::Acceleration(None), |()| Due::Nothing)
        };
        self.accelerometer_configured = due != Due::Acceleration(None);
        due
    }
}

impl Response {
    fn turn<A: SpiDevice>(&mut self, part: &mut Adxl355<A>) -> Result<Due, Error<A::Error>> {
        const FORCED: u8 = 1 + SETTLING + SUMMED;
        const END: u8 = 2 * FORCED;
        match self.turns {
            0 => part.configure(Mode::Test)?,
            FORCED => part.configure(Mode::Force)?,
            END => {
                part.configure(Mode::Measure)?;
                // 16 differences of codes of 20 bits at 64 000 a g; 2³¹ shall be 16.384 g.
                return Ok(Due::Response(TriadCode(self.sum.map(|sum| sum << 7))));
            }
            turns => {
                let sign = if turns < FORCED { -1 } else { 1 };
                let summed = turns % FORCED > SETTLING;
                for (sum, code) in self.sum.iter_mut().zip(part.measurement()?.acceleration.0) {
                    *sum += if summed { sign * (code >> 12) } else { 0 };
                }
            }
        }
        self.turns += 1;
        Ok(Due::Nothing)
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
        let acceleration = TriadCode([0, 0, 256_000 << 12]);
        let acceleration = Due::Acceleration(Some(Measurement { acceleration, ..Measurement::default() }));
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

    /// At rest z reads 1 g, 64 000 codes; under the force 2.5 g, x 0.25 g: by hand, 0.25 · 2³¹/16.384 and 1.5 · 2³¹/16.384.
    #[test]
    fn the_response_is_the_difference_of_two_means() {
        // 64 000 = 0x0FA00, 160 000 = 0x27100, 16 000 = 0x03E80, each left-aligned in three bytes.
        let reading = |x: [u8; 3], z: [u8; 3]| {
            let miso = [&[0, 0x01, 0, 0, 0][..], &x, &[0; 3], &z].concat();
            Exchange::new([0x09, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], miso)
        };
        let mut exchanges = MockSpi::adxl355_configured(0x83, 0x01);
        exchanges.extend((0..24).map(|_| reading([0; 3], [0x0F, 0xA0, 0x00])));
        exchanges.extend(MockSpi::adxl355_configured(0x83, 0x03));
        exchanges.extend((0..24).map(|_| reading([0x03, 0xE8, 0x00], [0x27, 0x10, 0x00])));
        exchanges.extend(MockSpi::adxl355_configuration());
        let mut sensors = Sensors::new(MockSpi::new(exchanges), MockSpi::new(vec![]), None::<MockSpi>);
        sensors.test_accelerometer();
        let due: Vec<Due> = (0..51).map(|turn| sensors.read(4 * turn)).collect();
        assert!(due[..50].iter().all(|due| *due == Due::Nothing));
        assert_eq!(due[50], Due::Response(TriadCode([32_768_000, 0, 196_608_000])));
    }

    #[test]
    fn a_failed_accelerometer_is_configured_anew() {
        let mut exchanges = vec![Exchange::new([0x01, 0, 0, 0], [0, 0, 0, 0])];
        exchanges.extend(MockSpi::adxl355_configuration());
        let mut sensors = Sensors::new(MockSpi::new(exchanges), MockSpi::new(vec![]), None::<MockSpi>);
        assert_eq!([sensors.read(0), sensors.read(4)], [Due::Acceleration(None), Due::Nothing]);
    }
}

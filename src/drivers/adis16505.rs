//! ADIS16505, the block of three gyros and three accelerometers, on SPI (mode 3, at most 1 MHz).
//!
//! It sums up what it turns and what it feels over 10 ms: 100 samples a second, in step with a pulse of 100 Hz that the board
//! gives it. Registers hold 16 bits, every frame has 16, and what a frame asks for comes with the next one; a burst gives one
//! sample whole.
//!
//! Source of registers, scales and times: Analog Devices, "ADIS16505", data sheet revision B.

use embedded_hal::spi::{Operation, SpiDevice};

use crate::units::RAD_PER_DEG;

const DIAG_STAT: u8 = 0x02;
const RANG_MDL: u8 = 0x5E;
const MSC_CTRL: u8 = 0x60;
const UP_SCALE: u8 = 0x62;
const DEC_RATE: u8 = 0x64;
const BURST: u8 = 0x68;
const PROD_ID: u8 = 0x72;

/// 16505 in decimal.
const IDENTITY: u16 = 0x4079;
/// Bursts of 32 bits (9) of increments (8), compensation of the gyros for acceleration (7) and of the accelerometers for their
/// places (6) as after reset, the board's pulse scaled up (3), sampled at its rising edge (1), data-ready active high (0).
const INCREMENTS_IN_STEP: u16 = 0x03CB;
/// 20 internal samples to a pulse, and 20 of them to a sample.
const INTERNAL_SAMPLES: u16 = 20;

/// Between two frames, ns.
const STALL_NS: u32 = 16_000;
/// Bytes of a burst after its command: status, six increments of 32 bits, temperature, counter, sum.
const BURST_BYTES: usize = 32;
/// Full scale of a velocity increment, m/s.
const VELOCITY_M_S: f64 = 100.0;
/// Counts of a full scale.
const FULL_SCALE: f64 = 2_147_483_648.0;

/// The block.
#[derive(Debug)]
pub struct Adis16505<SPI> {
    spi: SPI,
    state: State,
    /// Number of the last sample.
    last: Option<u16>,
}

/// How far the part is set up.
#[derive(Clone, Copy, Debug)]
enum State {
    Unknown,
    /// Its registers are written. It takes up to 0.2 ms until they can be read back: that is left to the next turn.
    Written(Range),
    Ready(Range),
}

/// What it is set to, register by register.
const SETTINGS: [(u8, u16); 3] =
    [(UP_SCALE, INTERNAL_SAMPLES), (DEC_RATE, INTERNAL_SAMPLES - 1), (MSC_CTRL, INCREMENTS_IN_STEP)];

/// Models by the range of their gyros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// ±125 °/s.
    Low,
    /// ±500 °/s.
    Middle,
    /// ±2000 °/s.
    High,
}

impl Range {
    /// Of an angle increment's last bit.
    fn rad_per_count(self) -> f64 {
        const fn of_full_scale(deg: f64) -> f64 {
            deg * RAD_PER_DEG / FULL_SCALE
        }
        match self {
            Self::Low => const { of_full_scale(360.0) },
            Self::Middle => const { of_full_scale(720.0) },
            Self::High => const { of_full_scale(2160.0) },
        }
    }
}

/// What the block summed up over 10 ms, and what it summed up that nobody read. As it came: whole numbers take half of the room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Increments {
    /// Integral of the rate against the stars about the block's x, y and z, right-handed, counts: see [`Self::angle_rad`].
    pub angle: [i32; 3],
    /// Integral of specific force along them, counts: see [`Self::velocity_m_s`].
    pub velocity: [i32; 3],
    pub range: Range,
    /// Its temperature, 0.1 °C.
    pub temperature: i16,
    /// Samples between this one and the one before that were never read.
    pub missed: u16,
}

impl Increments {
    /// Integral of the rate against the stars about the block's x, y and z, rad, right-handed.
    pub fn angle_rad(&self) -> [f64; 3] {
        let rad_per_count = self.range.rad_per_count();
        self.angle.map(|count| f64::from(count) * rad_per_count)
    }

    /// Integral of specific force along them, m/s.
    pub fn velocity_m_s(&self) -> [f64; 3] {
        self.velocity.map(|count| f64::from(count) * (VELOCITY_M_S / FULL_SCALE))
    }
}

/// What went wrong with the block. `E` is the bus's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error<E> {
    Bus(E),
    /// Not an ADIS16505 (PROD_ID 0x4079), or one that is starting still.
    Identity {
        found: u16,
    },
    /// A model whose range is not known.
    Range {
        found: u16,
    },
    /// A register does not hold what was written to it.
    Configuration {
        register: u8,
        written: u16,
        read: u16,
    },
    /// Its own checks failed.
    Status {
        status: u16,
    },
    /// The sum of a burst is wrong.
    Sum,
    /// The sample that was read before.
    NotNew,
}

impl<SPI: SpiDevice> Adis16505<SPI> {
    /// Touches no bus: a part that is still starting gets its time.
    pub fn new(spi: SPI) -> Self {
        Self { spi, state: State::Unknown, last: None }
    }

    /// The newest sample. The first two calls, and those after an error, set the part up and have none to give.
    ///
    /// Errors: as [`Error`]; the part is set up anew with the next call, for it may have lost its supply, but for a sample that is not new.
    pub fn increments(&mut self) -> Result<Option<Increments>, Error<SPI::Error>> {
        let result = match self.state {
            State::Unknown => self.configure().map(|range| (State::Written(range), None)),
            State::Written(range) => self.check().map(|()| (State::Ready(range), None)),
            State::Ready(range) => self.sample(range).map(|sample| (State::Ready(range), Some(sample))),
        };
        match result {
            Ok((state, sample)) => {
                self.state = state;
                Ok(sample)
            }
            Err(error) => {
                if !matches!(error, Error::NotNew) {
                    (self.state, self.last) = (State::Unknown, None);
                }
                Err(error)
            }
        }
    }

    /// Finds out whether the part is there and of which model it is, and makes it send increments at 100 Hz.
    fn configure(&mut self) -> Result<Range, Error<SPI::Error>> {
        let found = self.read(PROD_ID)?;
        if found != IDENTITY {
            return Err(Error::Identity { found });
        }
        let range = match self.read(RANG_MDL)? {
            0x0003 => Range::Low,
            0x0007 => Range::Middle,
            0x000F => Range::High,
            found => return Err(Error::Range { found }),
        };
        for (register, value) in SETTINGS {
            let [high, low] = value.to_be_bytes();
            self.frame([0x80 | register, low])?;
            self.frame([0x80 | (register + 1), high])?;
        }
        Ok(range)
    }

    /// Checks that the part is set up. Its error flags stay until they are read: from here on they are those of the samples.
    fn check(&mut self) -> Result<(), Error<SPI::Error>> {
        for (register, written) in SETTINGS {
            let read = self.read(register)?;
            if read != written {
                return Err(Error::Configuration { register, written, read });
            }
        }
        self.read(DIAG_STAT).map(|_| ())
    }

    fn sample(&mut self, range: Range) -> Result<Increments, Error<SPI::Error>> {
        let mut burst = [0; BURST_BYTES];
        let operations =
            &mut [Operation::DelayNs(STALL_NS), Operation::Write(&[BURST, 0]), Operation::Read(&mut burst)];
        self.spi.transaction(operations).map_err(Error::Bus)?;
        let [summed @ .., sum_high, sum_low] = burst;
        let sum = summed.iter().fold(0_u16, |sum, &byte| sum.wrapping_add(byte.into()));
        if sum != u16::from_be_bytes([sum_high, sum_low]) {
            return Err(Error::Sum);
        }
        let [status_high, status_low, data @ .., warm_high, warm_low, number_high, number_low] = summed;
        let status = u16::from_be_bytes([status_high, status_low]);
        // A bus that is stuck low has a right sum, too: its numbers do not go on, and that shows below.
        if status != 0 {
            return Err(Error::Status { status });
        }
        let number = u16::from_be_bytes([number_high, number_low]);
        let steps = self.last.map_or(1, |last| number.wrapping_sub(last));
        let missed = steps.checked_sub(1).ok_or(Error::NotNew)?;
        self.last = Some(number);
        let mut counts = [0; 6];
        for (count, &[low_1, low_0, high_1, high_0]) in counts.iter_mut().zip(data.as_chunks().0) {
            *count = i32::from_be_bytes([high_1, high_0, low_1, low_0]);
        }
        let [x, y, z, u, v, w] = counts;
        Ok(Increments {
            angle: [x, y, z],
            velocity: [u, v, w],
            range,
            temperature: i16::from_be_bytes([warm_high, warm_low]),
            missed,
        })
    }

    fn read(&mut self, register: u8) -> Result<u16, Error<SPI::Error>> {
        self.frame([register, 0])?;
        self.frame([0, 0]).map(u16::from_be_bytes)
    }

    /// One frame out, one in.
    fn frame(&mut self, mut word: [u8; 2]) -> Result<[u8; 2], Error<SPI::Error>> {
        let operations = &mut [Operation::DelayNs(STALL_NS), Operation::TransferInPlace(&mut word)];
        self.spi.transaction(operations).map_err(Error::Bus)?;
        Ok(word)
    }
}

#[cfg(test)]
mod tests {
    use super::super::mock::{Exchange, MockSpi};
    use super::*;
    extern crate std;
    use std::vec::Vec;

    /// The frames that find the model for ±500 °/s and set it up, in the second turn check it: by hand from the data sheet.
    fn configuration() -> Vec<Exchange> {
        let frames = [
            ([0x72, 0x00], [0, 0]),
            ([0x00, 0x00], [0x40, 0x79]),
            ([0x5E, 0x00], [0, 0]),
            ([0x00, 0x00], [0x00, 0x07]),
            ([0xE2, 0x14], [0, 0]),
            ([0xE3, 0x00], [0, 0]),
            ([0xE4, 0x13], [0, 0]),
            ([0xE5, 0x00], [0, 0]),
            ([0xE0, 0xCB], [0, 0]),
            ([0xE1, 0x03], [0, 0]),
            ([0x62, 0x00], [0, 0]),
            ([0x00, 0x00], [0x00, 0x14]),
            ([0x64, 0x00], [0, 0]),
            ([0x00, 0x00], [0x00, 0x13]),
            ([0x60, 0x00], [0, 0]),
            ([0x00, 0x00], [0x03, 0xCB]),
            ([0x02, 0x00], [0, 0]),
            ([0x00, 0x00], [0x00, 0x80]),
        ];
        frames.into_iter().map(|(mosi, miso)| Exchange::new(mosi, miso)).collect()
    }

    /// Calls until it is set up.
    const SETTING_UP: usize = 2;

    /// A burst with these words of status, angles and velocities, a temperature of 0x00FA and this number.
    fn burst(status: u16, words: [u16; 12], number: u16) -> Exchange {
        let mut mosi = [0; 34];
        mosi[0] = 0x68;
        let mut miso: Vec<u8> =
            [0, status].iter().chain(&words).chain(&[0x00FA, number]).flat_map(|w| w.to_be_bytes()).collect();
        let sum: u16 = miso.iter().map(|&byte| u16::from(byte)).sum();
        miso.extend(sum.to_be_bytes());
        Exchange::new(mosi, miso)
    }

    fn read(
        bursts: impl IntoIterator<Item = Exchange>,
    ) -> Vec<Result<Option<Increments>, Error<core::convert::Infallible>>> {
        let mut exchanges = configuration();
        let set_up = exchanges.len();
        exchanges.extend(bursts);
        let calls = SETTING_UP + exchanges.len() - set_up;
        let mut part = Adis16505::new(MockSpi::new(exchanges));
        let mut results: Vec<_> = (0..calls).map(|_| part.increments()).collect();
        assert!(results.drain(..SETTING_UP).all(|result| result == Ok(None)));
        results
    }

    #[test]
    fn increments_by_hand_calculation() {
        // Low word first. 90° of 720° is 2²⁸ = 0x1000_0000; −1 bit is 0xFFFF_FFFF; 0.0980665 m/s of 100 is 2105962 = 0x0020_226A.
        let words = [0, 0x1000, 0xFFFF, 0xFFFF, 0, 0, 0, 0, 0, 0, 0x226A, 0x0020];
        let sample = read([burst(0, words, 7)])[0].unwrap().unwrap();
        let (angle_rad, velocity_m_s) = (sample.angle_rad(), sample.velocity_m_s());
        assert!((angle_rad[0] - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((angle_rad[1] + 720.0 / 2_147_483_648.0 * core::f64::consts::PI / 180.0).abs() < 1e-24);
        assert!((velocity_m_s[2] - 0.0980665).abs() < 1e-7);
        // 0x00FA is 250 times 0.1 °C.
        assert_eq!(sample.temperature, 250);
        assert_eq!((angle_rad[2], velocity_m_s[0], sample.missed), (0.0, 0.0, 0));
    }

    #[test]
    fn samples_that_nobody_read_are_counted_over_the_wrap() {
        let results =
            read([burst(0, [0; 12], 0xFFFE), burst(0, [0; 12], 0xFFFF), burst(0, [0; 12], 2), burst(0, [0; 12], 2)]);
        let missed = |result: &Result<Option<Increments>, _>| result.map(|sample| sample.map(|sample| sample.missed));
        assert_eq!(
            results.iter().map(missed).collect::<Vec<_>>(),
            [Ok(Some(0)), Ok(Some(0)), Ok(Some(2)), Err(Error::NotNew)]
        );
    }

    #[test]
    fn what_is_wrong_is_named_and_the_part_set_up_anew() {
        let mut wrong_sum = burst(0, [1; 12], 1);
        wrong_sum.damage();
        for (wrong, error) in [(wrong_sum, Error::Sum), (burst(0x0020, [0; 12], 1), Error::Status { status: 0x20 })] {
            let again = configuration().into_iter().chain([burst(0, [0; 12], 9)]);
            let exchanges: Vec<Exchange> = configuration().into_iter().chain([wrong]).chain(again).collect();
            let mut part = Adis16505::new(MockSpi::new(exchanges));
            let results: Vec<_> = (0..6).map(|_| part.increments()).collect();
            assert_eq!(results[..5], [Ok(None), Ok(None), Err(error), Ok(None), Ok(None)]);
            assert_eq!(results[5].unwrap().unwrap().missed, 0);
        }
    }

    #[test]
    fn a_register_that_does_not_take_its_value_is_named() {
        let mut exchanges = configuration();
        // The lower half of UP_SCALE, read back.
        exchanges[11].damage();
        let mut part = Adis16505::new(MockSpi::new(exchanges));
        assert_eq!(part.increments(), Ok(None));
        assert_eq!(part.increments(), Err(Error::Configuration { register: 0x62, written: 0x14, read: 0x15 }));
    }

    #[test]
    fn another_part_or_a_stuck_bus_is_refused() {
        let answers = |identity: [u8; 2]| {
            MockSpi::new([Exchange::new([0x72, 0], [0, 0]), Exchange::new([0, 0], identity)].into())
        };
        for identity in [[0xFF, 0xFF], [0, 0], [0x40, 0x7B]] {
            let found = u16::from_be_bytes(identity);
            assert_eq!(Adis16505::new(answers(identity)).increments(), Err(Error::Identity { found }));
        }
        // Stuck low in the middle: the sum of nothing is nothing, but the number does not go on.
        let stuck = Exchange::new([&[0x68][..], &[0; 33]].concat(), [0; 34]);
        let results = read([burst(0, [0; 12], 0), stuck]);
        assert_eq!(results[1], Err(Error::NotNew));
    }
}

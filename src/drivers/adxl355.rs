//! ADXL355, the digital accelerometer triad, on SPI (mode 0, at most 10 MHz).
//!
//! Source of registers and scale: Analog Devices, "ADXL354/ADXL355", data sheet revision B.

use embedded_hal::spi::SpiDevice;
use quantities::codes::{TriadCode, TriadTemperature};

const DEVID_AD: u8 = 0x00;
const STATUS: u8 = 0x04;
const FILTER: u8 = 0x28;
const RANGE: u8 = 0x2C;
const POWER_CTL: u8 = 0x2D;
const SELF_TEST: u8 = 0x2E;

/// DEVID_AD, DEVID_MST and PARTID.
const IDENTITY: [u8; 3] = [0xAD, 0x1D, 0xED];
/// Output data rate 125 Hz, low pass 31.25 Hz, no high pass.
const FILTER_125_HZ: u8 = 0x05;
/// ±2.048 g; the interrupt polarity and I²C speed bits as after reset.
const RANGE_2_G: u8 = 0x81;
/// ±8.192 g: with the test force of 1.5 g and gravity, z is beyond ±2.048 g.
const RANGE_8_G: u8 = 0x83;
const STANDBY: u8 = 0x01;
const MEASURE: u8 = 0x00;

const STATUS_DATA_READY: u8 = 0x01;
const STATUS_NVM_BUSY: u8 = 0x10;
/// Bits that always read 0: a bus that is stuck high shows here.
const STATUS_RESERVED: u8 = 0xE0;

/// What the accelerometer is configured for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// To measure.
    Measure,
    /// Its own test, without its force (ST1), and with it (ST1 and ST2): ±8.192 g.
    Test,
    Force,
}

impl Mode {
    /// RANGE and SELF_TEST.
    fn registers(self) -> [u8; 2] {
        match self {
            Self::Measure => [RANGE_2_G, 0b00],
            Self::Test => [RANGE_8_G, 0b01],
            Self::Force => [RANGE_8_G, 0b11],
        }
    }
}

/// A measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measurement {
    /// Specific force along the part's x, y and z. Its 20 bits of ±2.048 g, 256 000 codes in a g, are the upper ones of the
    /// result's 32. (In its own test the range is four times as wide.)
    pub acceleration: TriadCode,
    /// Its temperature registers are not latched as the axes are: between their two bytes they may change, and are off by 256 codes, 28 K.
    pub temperature: TriadTemperature,
}

/// The accelerometer.
#[derive(Debug)]
pub struct Adxl355<SPI> {
    spi: SPI,
}

/// What went wrong with the accelerometer. `E` is the bus's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error<E> {
    Bus(E),
    /// Not an ADXL355: its DEVID_AD, DEVID_MST and PARTID should be AD 1D ED.
    Identity {
        found: [u8; 3],
    },
    /// A register does not hold what was written to it.
    Configuration {
        register: u8,
        written: u8,
        read: u8,
    },
    /// No new measurement: the part is in standby, starting, or dead.
    NotReady {
        status: u8,
    },
}

impl<SPI: SpiDevice> Adxl355<SPI> {
    pub fn new(spi: SPI) -> Self {
        Self { spi }
    }

    /// Checks that the part is there and makes it measure: 125 Hz, low pass 31.25 Hz, ±2.048 g or what the mode says. The first
    /// measurement is ready some 10 ms later.
    pub fn configure(&mut self, mode: Mode) -> Result<(), Error<SPI::Error>> {
        let mut found = [0; 3];
        self.read(DEVID_AD, &mut found)?;
        if found != IDENTITY {
            return Err(Error::Identity { found });
        }
        // Range and filter may only be changed in standby.
        let [range, test] = mode.registers();
        let settings =
            [(POWER_CTL, STANDBY), (FILTER, FILTER_125_HZ), (RANGE, range), (SELF_TEST, test), (POWER_CTL, MEASURE)];
        for (register, written) in settings {
            self.spi.write(&[register << 1, written]).map_err(Error::Bus)?;
            let mut read = [0];
            self.read(register, &mut read)?;
            if read != [written] {
                let [read] = read;
                return Err(Error::Configuration { register, written, read });
            }
        }
        Ok(())
    }

    /// The newest measurement. It is read once: before the next is there, the error is [`Error::NotReady`].
    pub fn measurement(&mut self) -> Result<Measurement, Error<SPI::Error>> {
        // Status, FIFO entries, two of temperature, then three bytes for each axis: one burst, one instant.
        let mut burst = [0; 13];
        self.read(STATUS, &mut burst)?;
        let [status, _, warm_high, warm_low, axes @ ..] = burst;
        if status & (STATUS_DATA_READY | STATUS_NVM_BUSY | STATUS_RESERVED) != STATUS_DATA_READY {
            return Err(Error::NotReady { status });
        }
        let [x2, x1, x0, y2, y1, y0, z2, z1, z0] = axes;
        Ok(Measurement {
            acceleration: TriadCode([[x2, x1, x0], [y2, y1, y0], [z2, z1, z0]].map(upper_20_bits)),
            temperature: TriadTemperature(u16::from_be_bytes([warm_high & 0x0F, warm_low])),
        })
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) -> Result<(), Error<SPI::Error>> {
        use embedded_hal::spi::Operation;
        let address = [register << 1 | 1];
        self.spi.transaction(&mut [Operation::Write(&address), Operation::Read(bytes)]).map_err(Error::Bus)
    }
}

/// 20 bits, two's complement, left-aligned in three bytes.
fn upper_20_bits([high, middle, low]: [u8; 3]) -> i32 {
    i32::from_be_bytes([high, middle, low & 0xF0, 0])
}

#[cfg(test)]
mod tests {
    use super::super::mock::{Exchange, MockSpi};
    use super::*;
    extern crate std;
    use std::vec;

    #[test]
    fn configures_range_filter_and_measurement() {
        let mut spi = MockSpi::new(MockSpi::adxl355_configuration());
        assert_eq!(Adxl355::new(&mut spi).configure(Mode::Measure), Ok(()));
        spi.done();
    }

    /// ST1 is bit 0 and ST2 bit 1 of register 2E, sent as 5C; ±8.192 g is 3 in the lower bits of RANGE.
    #[test]
    fn its_own_test_is_in_the_widest_range() {
        for (mode, test) in [(Mode::Test, 0x01), (Mode::Force, 0x03)] {
            let mut spi = MockSpi::new(MockSpi::adxl355_configured(0x83, test));
            assert_eq!(Adxl355::new(&mut spi).configure(mode), Ok(()));
            spi.done();
        }
    }

    #[test]
    fn another_part_is_refused() {
        let mut spi = MockSpi::new(vec![Exchange::new([0x01, 0, 0, 0], [0, 0xAD, 0x1D, 0xEE])]);
        assert_eq!(Adxl355::new(&mut spi).configure(Mode::Measure), Err(Error::Identity { found: [0xAD, 0x1D, 0xEE] }));
    }

    #[test]
    fn a_register_that_does_not_take_its_value_is_named() {
        let mut exchanges = MockSpi::adxl355_configuration();
        exchanges[6] = Exchange::new([0x59, 0], [0, 0x82]);
        let mut spi = MockSpi::new(exchanges);
        let expected = Error::Configuration { register: 0x2C, written: 0x81, read: 0x82 };
        assert_eq!(Adxl355::new(&mut spi).configure(Mode::Measure), Err(expected));
    }

    fn read(status: u8, axes: [u8; 9]) -> Result<Measurement, Error<core::convert::Infallible>> {
        let mut mosi = [0; 14];
        mosi[0] = 0x09;
        let mut miso = vec![0, status, 0, 0xF6, 0xA8];
        miso.extend(axes);
        let mut spi = MockSpi::new(vec![Exchange::new(mosi, miso)]);
        Adxl355::new(&mut spi).measurement()
    }

    #[test]
    fn codes_by_hand_calculation() {
        // 1 g = 256000 = 0x3E800, left-aligned 3E 80 0x; -0.5 g = -128000 = 0xE0C00; -1 LSB = 0xFFFFF.
        let axes = [0xE0, 0xC0, 0x0F, 0xFF, 0xFF, 0xF0, 0x3E, 0x80, 0x00];
        let Measurement { acceleration, temperature } = read(0x01, axes).unwrap();
        assert_eq!(acceleration.g(), [-0.5, -1.0 / 256_000.0, 1.0]);
        // The upper bits of TEMP2 are reserved: 0x6A8 = 1704, 181 codes below 1885, which are 20 K.
        assert_eq!(temperature, TriadTemperature(1704));
    }

    #[test]
    fn without_a_new_measurement_there_is_no_reading() {
        assert_eq!(read(0x00, [0; 9]), Err(Error::NotReady { status: 0x00 }));
        assert_eq!(read(0x11, [0; 9]), Err(Error::NotReady { status: 0x11 }));
    }

    #[test]
    fn a_stuck_bus_is_not_a_reading() {
        assert_eq!(read(0xFF, [0xFF; 9]), Err(Error::NotReady { status: 0xFF }));
        assert_eq!(read(0x00, [0; 9]), Err(Error::NotReady { status: 0x00 }));
        let mut stuck_low = MockSpi::new(vec![Exchange::new([0x01, 0, 0, 0], [0; 4])]);
        assert_eq!(Adxl355::new(&mut stuck_low).configure(Mode::Measure), Err(Error::Identity { found: [0; 3] }));
    }
}

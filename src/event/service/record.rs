//! What the log holds: records of 32 bytes, each with its check sum.
//!
//! A flash keeps a thousand fixes and more where one of its two sectors, of 64 KiB, was just left alone by an erase: 32 bytes are what a record may take. Numbers are
//! little-endian; a number of 3 bytes is an `f32` without its lowest byte (16 bits of mantissa), one of 2 bytes without its lower half (8 bits).
//!
//! | kind | record | fields |
//! |---|---|---|
//! | 1, 2 | a fix; the first since a switch-on | flags (3 bytes), seconds since the start (3), since 1970 (4, 0: no host has set the clock), azimuth (3, 2⁻²⁴ of a turn), sigma in ° (2), chi-square (2), its degrees of freedom (2), bias (3) and amplitude (3) in °/h, drift in °/h per h (2), the gyro's temperature in °C/100 (2, 8000 hexadecimal: none) |
//! | 3 | what holds for the fixes after it | number of the sector in the order of writing (4), of the last fix (4), of the last switch-on (4), CRC-32 of the program (4), of the error model (4, 0: none) |
//! | 4 | a surveyed azimuth at which the last fix was made | ° (8) |
//! | 5 | a part of a crash | its number (1), from 0; 25 bytes of the words of [`crate::event::restart::Crash::to_words`], which four parts hold |
//! | 6 | what else was measured with the fix before | scatter of its seconds in °/h (3), the block's temperature in °C/100 (2, as the gyro's), the analogue channels (3 each; not-a-number: none) |
//!
//! The last two bytes are the CRC-16/IBM-SDLC of the others. A record all of whose bytes are FF is not written yet.

use crc::{CRC_16_IBM_SDLC, Crc, NoTable};

use crate::event::Auxiliary;
use crate::fix::Fix;
use crate::health::Flags;

/// Bytes of a record.
pub const LENGTH: usize = 32;
/// Bytes of a crash in a record.
pub const CRASH_PART: usize = 25;
const CONTENT: usize = LENGTH - 2;
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_SDLC);
const TURN: f64 = 16_777_216.0;

/// A fix as the log holds it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Logged {
    /// It is the first since a switch-on.
    pub first: bool,
    /// Since the start; at most 2²⁴ − 1.
    pub t_s: u32,
    /// Since 1970, UTC; `None`: no host has set the clock.
    pub utc_s: Option<u32>,
    pub azimuth_deg: f64,
    pub sigma_deg: f32,
    pub chi_square: f32,
    pub degrees_of_freedom: u16,
    pub bias_deg_h: f32,
    pub amplitude_deg_h: f32,
    pub drift_deg_h_per_h: f32,
    pub temp_c: Option<f32>,
    pub flags: Flags,
}

/// What holds for the fixes after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Context {
    /// Number of the sector in the order of writing, from 1.
    pub sector: u32,
    /// Numbers of the fix, and of the switch-on, before.
    pub fix: u32,
    pub boot: u32,
    /// CRC-32 of the program, and of the error model; 0: there is none.
    pub firmware: u32,
    pub model: u32,
}

/// What a place of the log holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Record {
    Fix(Logged),
    Context(Context),
    /// The last fix was made at this surveyed azimuth, degrees.
    Check(f64),
    Crash(CrashPart),
    More(More),
}

/// What else was measured with a fix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct More {
    /// Root mean square of a dwell's seconds about their mean, over all dwells, °/h.
    pub scatter_deg_h: f32,
    pub block_temp_c: Option<f32>,
    pub auxiliary: Auxiliary,
}

/// A part of a crash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CrashPart {
    pub number: u8,
    pub bytes: [u8; CRASH_PART],
}

/// What the bytes of a place are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    Blank,
    /// Written in part, or of a later version.
    Unreadable,
    Holds(Record),
}

impl Logged {
    /// A fix with what the log can hold of it: what is watched live is what is watched again after a switch-on.
    pub fn of(fix: &Fix) -> Self {
        let logged = Self {
            azimuth_deg: fix.azimuth_deg,
            sigma_deg: fix.sigma_deg as f32,
            chi_square: fix.chi_square as f32,
            degrees_of_freedom: fix.degrees_of_freedom,
            bias_deg_h: fix.bias_deg_h as f32,
            amplitude_deg_h: fix.amplitude_deg_h as f32,
            drift_deg_h_per_h: fix.drift_deg_h_per_h as f32,
            flags: fix.flags,
            ..Self::default()
        };
        match read(&Record::Fix(logged).bytes()) {
            Place::Holds(Record::Fix(held)) => held,
            _ => logged,
        }
    }
}

impl Record {
    pub fn bytes(&self) -> [u8; LENGTH] {
        let mut writer = Writer { bytes: [0; LENGTH], at: 0 };
        match self {
            Self::Fix(fix) => {
                writer.put(&[if fix.first { 2 } else { 1 }]);
                writer.low(fix.flags.bits(), 3);
                writer.low(fix.t_s.min(0xFF_FFFF), 3);
                writer.low(fix.utc_s.unwrap_or(0), 4);
                writer.low(libm::round(fix.azimuth_deg / 360.0 * TURN) as u32, 3);
                writer.float(fix.sigma_deg, 2);
                writer.float(fix.chi_square, 2);
                writer.put(&fix.degrees_of_freedom.to_le_bytes());
                writer.float(fix.bias_deg_h, 3);
                writer.float(fix.amplitude_deg_h, 3);
                writer.float(fix.drift_deg_h_per_h, 2);
                writer.temperature(fix.temp_c);
            }
            Self::Context(Context { sector, fix, boot, firmware, model }) => {
                writer.put(&[3]);
                [sector, fix, boot, firmware, model].iter().for_each(|number| writer.low(**number, 4));
            }
            Self::Check(azimuth_deg) => {
                writer.put(&[4]);
                writer.put(&azimuth_deg.to_le_bytes());
            }
            Self::Crash(part) => {
                writer.put(&[5, part.number]);
                writer.put(&part.bytes);
            }
            Self::More(More { scatter_deg_h, block_temp_c, auxiliary }) => {
                writer.put(&[6]);
                writer.float(*scatter_deg_h, 3);
                writer.temperature(*block_temp_c);
                auxiliary.iter().for_each(|value| writer.float(value.unwrap_or(f32::NAN), 3));
            }
        }
        writer.finish()
    }
}

/// What the bytes of a place say.
pub fn read(bytes: &[u8; LENGTH]) -> Place {
    if bytes.iter().all(|&byte| byte == 0xFF) {
        return Place::Blank;
    }
    let Some((content, check)) = bytes.split_last_chunk::<2>() else { return Place::Unreadable };
    let mut reader = Reader(content);
    let record = match reader.low(1) {
        _ if CRC.checksum(content) != u16::from_le_bytes(*check) => return Place::Unreadable,
        kind @ (1 | 2) => {
            let flags = Flags::from_bits(reader.low(3));
            let (t_s, utc_s) = (reader.low(3), Some(reader.low(4)).filter(|&utc_s| utc_s > 0));
            let azimuth_deg = f64::from(reader.low(3)) * 360.0 / TURN;
            Record::Fix(Logged {
                first: kind == 2,
                t_s,
                utc_s,
                azimuth_deg,
                sigma_deg: reader.float(2),
                chi_square: reader.float(2),
                degrees_of_freedom: reader.low(2) as u16,
                bias_deg_h: reader.float(3),
                amplitude_deg_h: reader.float(3),
                drift_deg_h_per_h: reader.float(2),
                temp_c: reader.temperature(),
                flags,
            })
        }
        3 => Record::Context(Context {
            sector: reader.low(4),
            fix: reader.low(4),
            boot: reader.low(4),
            firmware: reader.low(4),
            model: reader.low(4),
        }),
        4 => {
            let (low, high) = (reader.low(4), reader.low(4));
            Record::Check(f64::from_bits(u64::from(high) << 32 | u64::from(low)))
        }
        5 => {
            let number = reader.low(1) as u8;
            let Some((bytes, _)) = reader.0.split_first_chunk() else { return Place::Unreadable };
            Record::Crash(CrashPart { number, bytes: *bytes })
        }
        6 => Record::More(More {
            scatter_deg_h: reader.float(3),
            block_temp_c: reader.temperature(),
            auxiliary: core::array::from_fn(|_| Some(reader.float(3)).filter(|value| value.is_finite())),
        }),
        _ => return Place::Unreadable,
    };
    Place::Holds(record)
}

struct Writer {
    bytes: [u8; LENGTH],
    at: usize,
}

impl Writer {
    fn put(&mut self, bytes: &[u8]) {
        for (place, byte) in self.bytes.iter_mut().skip(self.at).zip(bytes) {
            *place = *byte;
        }
        self.at += bytes.len();
    }

    /// The lowest bytes of a number.
    fn low(&mut self, number: u32, count: usize) {
        self.put(number.to_le_bytes().get(..count).unwrap_or_default());
    }

    /// The highest bytes of a number, rounded.
    fn float(&mut self, number: f32, count: usize) {
        let cut = 8 * (4 - count as u32);
        let rounded = number.to_bits().saturating_add(1 << (cut - 1)) >> cut;
        self.low(rounded, count);
    }

    /// °C/100.
    fn temperature(&mut self, temp_c: Option<f32>) {
        let count = temp_c.map_or(i16::MIN, |temp_c| libm::roundf(100.0 * temp_c) as i16);
        self.put(&count.to_le_bytes());
    }

    fn finish(mut self) -> [u8; LENGTH] {
        let check = CRC.checksum(self.bytes.get(..CONTENT).unwrap_or_default());
        self.at = CONTENT;
        self.put(&check.to_le_bytes());
        self.bytes
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn low(&mut self, count: usize) -> u32 {
        let (now, later) = self.0.split_at_checked(count).unwrap_or((self.0, &[]));
        self.0 = later;
        now.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
    }

    fn temperature(&mut self) -> Option<f32> {
        Some(self.low(2) as u16 as i16).filter(|&count| count != i16::MIN).map(|count| f32::from(count) / 100.0)
    }

    fn float(&mut self, count: usize) -> f32 {
        f32::from_bits(self.low(count) << (8 * (4 - count as u32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::health::Flag;

    fn fix() -> Logged {
        let mut flags = Flags::default();
        flags.insert(Flag::Misfit);
        Logged {
            first: true,
            t_s: 3600,
            utc_s: Some(1_800_000_000),
            azimuth_deg: 359.9999,
            sigma_deg: 0.0123,
            chi_square: 7.5,
            degrees_of_freedom: 11,
            bias_deg_h: -1.234_567,
            amplitude_deg_h: 12.36,
            drift_deg_h_per_h: -0.02,
            temp_c: Some(-12.34),
            flags,
        }
    }

    #[test]
    fn a_fix_is_read_to_the_digits_that_the_log_holds() {
        let Place::Holds(Record::Fix(read)) = read(&Record::Fix(fix()).bytes()) else { panic!() };
        let Logged { azimuth_deg, sigma_deg, chi_square, bias_deg_h, amplitude_deg_h, drift_deg_h_per_h, .. } = read;
        assert!((azimuth_deg - 359.9999).abs() < 1.1e-5);
        // Half of the last bit: 2^-9 and 2^-17 of the number.
        let near = |read: f32, written: f32, bits: i32| (read / written - 1.0).abs() <= 2_f32.powi(-bits);
        assert!(near(sigma_deg, 0.0123, 8) && near(chi_square, 7.5, 8) && near(drift_deg_h_per_h, -0.02, 8));
        assert!(near(bias_deg_h, -1.234_567, 16) && near(amplitude_deg_h, 12.36, 16));
        let exact =
            Logged { azimuth_deg, sigma_deg, chi_square, bias_deg_h, amplitude_deg_h, drift_deg_h_per_h, ..fix() };
        assert_eq!(read, exact);
        // What was read is written as the same bytes.
        assert_eq!(Record::Fix(read).bytes(), Record::Fix(fix()).bytes());
    }

    #[test]
    fn other_records_are_read_as_they_were_written() {
        let context = Context { sector: 7, fix: 70_000, boot: 300, firmware: 0xDEAD_BEEF, model: 1 };
        for record in [
            Record::Context(context),
            Record::Crash(CrashPart { number: 3, bytes: core::array::from_fn(|at| at as u8) }),
            Record::Check(123.456_789),
            Record::More(More {
                scatter_deg_h: 0.125,
                block_temp_c: Some(-3.25),
                auxiliary: [Some(-0.5), None, Some(1024.0), None, Some(12.0), Some(41.5)],
            }),
            Record::Fix(Logged { temp_c: None, ..Logged::default() }),
        ] {
            assert_eq!(read(&record.bytes()), Place::Holds(record));
        }
        assert_eq!(read(&[0xFF; LENGTH]), Place::Blank);
    }

    #[test]
    fn a_record_that_ends_early_is_none() {
        let whole = Record::Fix(fix()).bytes();
        for written in 1..LENGTH {
            let mut torn = [0xFF; LENGTH];
            torn[..written].copy_from_slice(&whole[..written]);
            assert_eq!(read(&torn), Place::Unreadable, "{written} bytes");
        }
    }
}

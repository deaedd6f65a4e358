//! What the log holds: records of 32 bytes, each with its check sum.
//!
//! A flash keeps two thousand fixes and more where one of its two sectors, of 64 KiB, was just left alone by an erase: 32 bytes are what a fix may take.
//! A record is a row of bits, each number's lowest first. A *float* is an `f32` without its lowest bits; a *ratio* of 12 bits is 2048 + 128 log₂ of a number, 0 for
//! nothing: from 2⁻¹⁶ to 2¹⁶, within 0.3 % of itself; a *count* is 1 for the least value, one more for each step above it, 0 where nothing was measured.
//!
//! | kind (4 bits) | record | fields (bits) |
//! |---|---|---|
//! | 8, 9 | a fix; the first since a switch-on | flags (24), seconds since the start (24), since 1970 (32, 0: no host has set the clock), azimuth (24, 2⁻²⁴ of a turn), ratios of sigma in °, chi-square and scatter in °/h (12 each), degrees of freedom (8), bias in °/h (24, float), amplitude (16, count of °/h/2048 from 0), drift in °/h per h (16, float), the gyro's temperature (14, count of °C/50 from −160), supply (9, count of V/10 from 0), the chip's temperature (9, count of °C/2 from −100) |
//! | 10 | what holds for the fixes after it | number of the sector in the order of writing (32), of the last fix (32), of the last switch-on (32), CRC-32 of the program (32), of the error model (32, 0: none) |
//! | 11 | a surveyed azimuth at which the last fix was made | ° (64) |
//! | 12 | a part of a crash | its number (8), from 0; 25 bytes of the words of [`crate::event::restart::Crash::to_words`], which four parts hold |
//! | 13 | what else was measured with the fix before, if anything was | the block's temperature (14, as the gyro's), the analogue inputs (24 each, float; not-a-number: none) |
//!
//! The last 16 bits are the CRC-16/IBM-SDLC of the other 30 bytes. A record all of whose bytes are FF is not written yet. Kinds below 8 are of the layout
//! before, in which a fix took two records: a log of such records is passed over, and a new one begins in its place.

mod bits;

use crate::fix::Fix;
use crate::health::Flags;
pub use bits::LENGTH;
use bits::{Reader, Steps, Writer};

/// Bytes of a crash in a record.
pub const CRASH_PART: usize = 25;
const TURN: f64 = 16_777_216.0;
const AMPLITUDE: Steps = Steps { bits: 16, per_unit: 2048.0, least: 0 };
const TEMPERATURE: Steps = Steps { bits: 14, per_unit: 50.0, least: -160 * 50 };
const SUPPLY: Steps = Steps { bits: 9, per_unit: 10.0, least: 0 };
const CHIP_TEMPERATURE: Steps = Steps { bits: 9, per_unit: 2.0, least: -100 * 2 };

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
    /// Root mean square of a dwell's seconds about their mean, over all dwells.
    pub scatter_deg_h: f32,
    pub temp_c: Option<f32>,
    pub supply_v: Option<f32>,
    pub chip_temp_c: Option<f32>,
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

/// What else was measured with a fix, where the instrument has it: a block of three gyros, analogue inputs that have a name.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct More {
    pub block_temp_c: Option<f32>,
    pub inputs: [Option<f32>; 4],
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

    fn read(reader: &mut Reader<'_>, first: bool) -> Self {
        Self {
            first,
            flags: Flags::from_bits(reader.bits(24)),
            t_s: reader.bits(24),
            utc_s: Some(reader.bits(32)).filter(|&utc_s| utc_s > 0),
            azimuth_deg: f64::from(reader.bits(24)) * 360.0 / TURN,
            sigma_deg: reader.ratio(),
            chi_square: reader.ratio(),
            scatter_deg_h: reader.ratio(),
            degrees_of_freedom: reader.bits(8) as u16,
            bias_deg_h: reader.float(24),
            amplitude_deg_h: reader.count(&AMPLITUDE).unwrap_or_default(),
            drift_deg_h_per_h: reader.float(16),
            temp_c: reader.count(&TEMPERATURE),
            supply_v: reader.count(&SUPPLY),
            chip_temp_c: reader.count(&CHIP_TEMPERATURE),
        }
    }
}

impl Record {
    pub fn bytes(&self) -> [u8; LENGTH] {
        let mut writer = Writer::default();
        match self {
            Self::Fix(fix) => {
                writer.bits(if fix.first { 9 } else { 8 }, 4);
                writer.bits(fix.flags.bits(), 24);
                writer.bits(fix.t_s.min(0xFF_FFFF), 24);
                writer.bits(fix.utc_s.unwrap_or(0), 32);
                writer.bits(libm::round(fix.azimuth_deg / 360.0 * TURN) as u32, 24);
                writer.ratio(fix.sigma_deg);
                writer.ratio(fix.chi_square);
                writer.ratio(fix.scatter_deg_h);
                writer.bits(fix.degrees_of_freedom.min(0xFF).into(), 8);
                writer.float(fix.bias_deg_h, 24);
                writer.count(Some(fix.amplitude_deg_h), &AMPLITUDE);
                writer.float(fix.drift_deg_h_per_h, 16);
                writer.count(fix.temp_c, &TEMPERATURE);
                writer.count(fix.supply_v, &SUPPLY);
                writer.count(fix.chip_temp_c, &CHIP_TEMPERATURE);
            }
            Self::Context(Context { sector, fix, boot, firmware, model }) => {
                writer.bits(10, 4);
                [sector, fix, boot, firmware, model].iter().for_each(|number| writer.bits(**number, 32));
            }
            Self::Check(azimuth_deg) => {
                writer.bits(11, 4);
                writer.bytes(&azimuth_deg.to_le_bytes());
            }
            Self::Crash(part) => {
                writer.bits(12, 4);
                writer.bytes(&[part.number]);
                writer.bytes(&part.bytes);
            }
            Self::More(More { block_temp_c, inputs }) => {
                writer.bits(13, 4);
                writer.count(*block_temp_c, &TEMPERATURE);
                inputs.iter().for_each(|value| writer.float(value.unwrap_or(f32::NAN), 24));
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
    let Some(mut reader) = Reader::checked(bytes) else { return Place::Unreadable };
    let record = match reader.bits(4) {
        kind @ (8 | 9) => Record::Fix(Logged::read(&mut reader, kind == 9)),
        10 => Record::Context(Context {
            sector: reader.bits(32),
            fix: reader.bits(32),
            boot: reader.bits(32),
            firmware: reader.bits(32),
            model: reader.bits(32),
        }),
        11 => Record::Check(f64::from_le_bytes(reader.bytes())),
        12 => {
            let [number] = reader.bytes();
            Record::Crash(CrashPart { number, bytes: reader.bytes() })
        }
        13 => Record::More(More {
            block_temp_c: reader.count(&TEMPERATURE),
            inputs: core::array::from_fn(|_| Some(reader.float(24)).filter(|value| value.is_finite())),
        }),
        _ => return Place::Unreadable,
    };
    Place::Holds(record)
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
            scatter_deg_h: 0.321,
            temp_c: Some(-12.34),
            supply_v: Some(12.3),
            chip_temp_c: Some(41.5),
            flags,
        }
    }

    #[test]
    fn a_fix_is_read_to_the_digits_that_the_log_holds() {
        let Place::Holds(Record::Fix(read)) = read(&Record::Fix(fix()).bytes()) else { panic!() };
        assert!((read.azimuth_deg - 359.9999).abs() < 1.1e-5);
        // Half a step of 1/128 of an octave is 0.27 %; half of the last bit of a float 2^-9 and 2^-17 of the number.
        let near = |read: f32, written: f32, share: f32| (read / written - 1.0).abs() <= share;
        let ratio = 0.00272;
        assert!(near(read.sigma_deg, 0.0123, ratio) && near(read.chi_square, 7.5, ratio));
        assert!(near(read.scatter_deg_h, 0.321, ratio) && near(read.drift_deg_h_per_h, -0.02, 1.0 / 256.0));
        assert!(near(read.bias_deg_h, -1.234_567, 1.0 / 65_536.0));
        assert!((read.amplitude_deg_h - 12.36).abs() <= 0.5 / 2048.0);
        let counts = [read.temp_c, read.supply_v, read.chip_temp_c].map(Option::unwrap);
        assert_eq!(counts, [-12.34, 12.3, 41.5]);
        assert_eq!((read.first, read.t_s, read.utc_s), (true, 3600, Some(1_800_000_000)));
        assert_eq!((read.degrees_of_freedom, read.flags), (11, fix().flags));
        // What was read is written as the same bytes.
        assert_eq!(Record::Fix(read).bytes(), Record::Fix(fix()).bytes());
    }

    /// Four bits at a time, the lowest first: 3600 is E10 hexadecimal, 90° a quarter of 2²⁴; ratios of 1/2, 8 and 1/4 are 2048 − 128, 2048 + 3 · 128 and
    /// 2048 − 2 · 128, 780, 980 and 700; −1.25 and 0.5 are BFA00000 and 3F000000 as f32; 12.5 · 2048 + 1 is 6401. The last 32 bits are
    /// (20.5 + 160) · 50 + 1 = 9026, 120 + 1 shifted by 14 and (41.5 + 100) · 2 + 1 = 284 shifted by 23: 8E1E6342.
    #[test]
    fn a_fix_by_hand() {
        let logged = Logged {
            azimuth_deg: 90.0,
            sigma_deg: 0.5,
            chi_square: 8.0,
            scatter_deg_h: 0.25,
            bias_deg_h: -1.25,
            amplitude_deg_h: 12.5,
            drift_deg_h_per_h: 0.5,
            temp_c: Some(20.5),
            supply_v: Some(12.0),
            ..fix()
        };
        let bytes = Record::Fix(logged).bytes();
        let halves =
            concat!("9", "080000", "01E000", "002D94B6", "000004", "087", "089", "007", "B0", "000AFB", "1046", "00F3");
        let halves = halves.bytes().chain(*b"2436E1E8").map(|digit| (digit as char).to_digit(16).unwrap() as u8);
        let halves: heapless::Vec<u8, 60> = halves.collect();
        let expected = halves.as_chunks().0.iter().map(|[low, high]| high << 4 | low);
        assert!(halves.is_full() && expected.eq(bytes[..30].iter().copied()), "{bytes:02x?}");
        assert_eq!(read(&bytes), Place::Holds(Record::Fix(logged)));
    }

    #[test]
    fn what_is_beyond_the_steps_is_the_last_one() {
        let of = |sigma_deg, amplitude_deg_h, supply_v| {
            let fix = Logged { sigma_deg, amplitude_deg_h, supply_v: Some(supply_v), ..Logged::default() };
            let Place::Holds(Record::Fix(read)) = read(&Record::Fix(fix).bytes()) else { panic!() };
            (read.sigma_deg, read.amplitude_deg_h, read.supply_v)
        };
        // 2^(2047/128); (2^16 − 2)/2048 and (2^9 − 2)/10.
        assert_eq!(of(1e9, 1e9, 1e9), (libm::exp2f(2047.0 / 128.0), 31.999_023, Some(51.0)));
        assert_eq!(of(1e-9, -1.0, -1.0), (libm::exp2f(-2047.0 / 128.0), 0.0, Some(0.0)));
        assert_eq!(of(f32::INFINITY, f32::NAN, f32::NAN).1, 0.0);
        assert_eq!(of(f32::NAN, 0.0, 0.0).0, 0.0);
    }

    #[test]
    fn other_records_are_read_as_they_were_written() {
        let context = Context { sector: 7, fix: 70_000, boot: 300, firmware: 0xDEAD_BEEF, model: 1 };
        for record in [
            Record::Context(context),
            Record::Crash(CrashPart { number: 3, bytes: core::array::from_fn(|at| at as u8) }),
            Record::Check(123.456_789),
            Record::More(More { block_temp_c: Some(-3.26), inputs: [Some(-0.5), None, Some(1024.0), None] }),
            Record::Fix(Logged::default()),
        ] {
            assert_eq!(read(&record.bytes()), Place::Holds(record));
        }
        assert_eq!(read(&[0xFF; LENGTH]), Place::Blank);
    }

    /// Records of the layout before begin with a byte of 1 to 6: their log is none, and a new one begins.
    #[test]
    fn a_record_of_the_layout_before_is_none() {
        for kind in 1..=6 {
            let mut writer = Writer::default();
            writer.bits(kind, 8);
            assert_eq!(read(&writer.finish()), Place::Unreadable);
        }
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

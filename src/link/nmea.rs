//! NMEA 0183 sentences for whoever wants a heading and nothing else: `HDT` and `THS`, talker `HE` (north-seeking gyro).
//!
//! A sentence is `$`, the comma-separated fields, `*`, the exclusive-or of all characters between the two as two
//! hexadecimal digits, carriage return and line feed (IEC 61162-1). The heading is that of the index-zero mark.

use core::fmt::Write;

use heapless::String;

use crate::units::wrap_360_deg;

/// Longest sentence that the standard allows, with `$` and the line's end.
pub const MAX_SENTENCE: usize = 82;

/// A sentence with its line's end.
pub type Sentence = String<MAX_SENTENCE>;

/// Mode letter of `THS`: what stands behind the heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// `A`: measured by the instrument itself, a finished fix.
    Autonomous,
    /// `E`: estimated, held by dead reckoning since the last fix.
    Estimated,
    /// `S`: the instrument is simulated.
    Simulator,
}

impl Mode {
    fn letter(self) -> char {
        match self {
            Self::Autonomous => 'A',
            Self::Estimated => 'E',
            Self::Simulator => 'S',
        }
    }
}

/// `$HEHDT`: true heading. `azimuth_deg` clockwise from true north, any turn; four decimals. There is no such sentence
/// without a heading: whoever has none sends none. `None` for not-a-number.
pub fn hdt(azimuth_deg: f64) -> Option<Sentence> {
    let [whole, decimals] = ten_thousandths(azimuth_deg)?;
    sentence(format_args!("HEHDT,{whole}.{decimals:04},T"))
}

/// `$HETHS`: true heading and its mode; without a valid heading the mode is `V` and the heading is empty.
pub fn ths(heading: Option<(f64, Mode)>) -> Option<Sentence> {
    match heading {
        Some((azimuth_deg, mode)) => {
            let [whole, decimals] = ten_thousandths(azimuth_deg)?;
            sentence(format_args!("HETHS,{whole}.{decimals:04},{}", mode.letter()))
        }
        None => sentence(format_args!("HETHS,,V")),
    }
}

/// Whole degrees and ten-thousandths of a degree in [0°, 360°): integers, because printing an `f64` costs a board
/// kilobytes of flash.
fn ten_thousandths(azimuth_deg: f64) -> Option<[u32; 2]> {
    let rounded = libm::round(wrap_360_deg(azimuth_deg) * 1e4);
    // 359.99996° rounds up to a full turn.
    let count = if rounded.is_finite() { rounded as u32 % 3_600_000 } else { return None };
    Some([count / 10_000, count % 10_000])
}

fn sentence(fields: core::fmt::Arguments<'_>) -> Option<Sentence> {
    let mut body = Sentence::new();
    body.write_fmt(fields).ok()?;
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    let mut sentence = Sentence::new();
    write!(sentence, "${body}*{sum:02X}\r\n").ok()?;
    Some(sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_sum_by_hand() {
        // HETHS,,V: H^E = 48^45 = 0D, ^T = 54: 59, ^H = 48: 11, ^S = 53: 42, two commas cancel, ^V = 56: 14.
        assert_eq!(ths(None).unwrap(), "$HETHS,,V*14\r\n");
    }

    #[test]
    fn headings_are_in_range_and_rounded() {
        assert!(hdt(39.97404).unwrap().starts_with("$HEHDT,39.9740,T*"));
        assert!(hdt(359.99996).unwrap().starts_with("$HEHDT,0.0000,T*"));
        assert!(hdt(-0.5).unwrap().starts_with("$HEHDT,359.5000,T*"));
        assert!(ths(Some((1.00006, Mode::Estimated))).unwrap().starts_with("$HETHS,1.0001,E*"));
        assert_eq!((hdt(f64::NAN), ths(Some((f64::INFINITY, Mode::Autonomous)))), (None, None));
    }

    #[test]
    fn a_parser_of_the_field_reads_them() {
        for (azimuth_deg, read) in [(39.97404, 39.974), (0.0, 0.0), (359.9, 359.9)] {
            let sentence = hdt(azimuth_deg).unwrap();
            let parsed = nmea::parse_str(&sentence).unwrap();
            let nmea::ParseResult::HDT(data) = parsed else { panic!("{sentence}") };
            assert!((data.heading.unwrap() - read).abs() < 1e-4);
        }
    }
}

//! NMEA 0183 sentences for whoever wants a heading and nothing else: `HDT` and `THS`, talker `HE` (north-seeking gyro), and a proprietary one
//! with what stands behind the heading.
//!
//! A sentence is `$`, the comma-separated fields, `*`, the exclusive-or of all characters between the two as two
//! hexadecimal digits, carriage return and line feed (IEC 61162-1). The heading is that of the index-zero mark.

use core::fmt::Write;

use heapless::String;
use inertial::Motion;

use crate::event::{Event, Fix, Heading, Report, State};
use crate::health::Flags;
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

/// `$PNOFF`: sigma of the heading (degrees, four decimals, at most 180), flags of its fix (eight hexadecimal digits: the bit of a flag is its
/// code), and the heading's mode. `None` for not-a-number.
pub fn pnoff(sigma_deg: f64, flags: Flags, mode: Mode) -> Option<Sentence> {
    // Written so that what is not a number stays none.
    let [whole, decimals] = ten_thousandths(if sigma_deg > 180.0 { 180.0 } else { sigma_deg })?;
    sentence(format_args!("PNOFF,{whole}.{decimals:04},{:08X},{}", flags.bits(), mode.letter()))
}

/// What the sentences say.
#[derive(Clone, Copy, Debug)]
struct Said {
    heading_deg: f64,
    sigma_deg: f64,
    flags: Flags,
    mode: Mode,
}

/// Makes sentences of reports: with every second `THS`, and, where there is a heading, `HDT` and `PNOFF`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Speaker {
    said: Option<Said>,
    simulated: bool,
}

impl Speaker {
    /// For a simulated instrument, whose sentences say so.
    pub fn simulator() -> Self {
        Self { simulated: true, ..Self::default() }
    }

    /// Hears a report; `say` gets the sentences that it leads to.
    pub fn hear(&mut self, report: &Report, say: &mut dyn FnMut(&str)) {
        let mode = |held: Mode| if self.simulated { Mode::Simulator } else { held };
        match &report.event {
            &Event::Fix(Fix { azimuth_deg: heading_deg, sigma_deg, flags, .. }) => {
                self.said = Some(Said { heading_deg, sigma_deg, flags, mode: mode(Mode::Autonomous) });
            }
            &Event::Heading(Heading { heading_deg, sigma_deg, motion, refix, .. }) => {
                let mode = mode(if motion == Motion::Standing { Mode::Autonomous } else { Mode::Estimated });
                let held = |said: Said| Said { heading_deg, sigma_deg, mode, ..said };
                self.said = self.said.filter(|_| !refix).map(held);
            }
            Event::State(State::Levelling | State::Failed | State::Calibrating) => self.said = None,
            Event::Second(_) => self.say(say),
            _ => {}
        }
    }

    fn say(&self, say: &mut dyn FnMut(&str)) {
        let sentences = [
            ths(self.said.map(|said| (said.heading_deg, said.mode))),
            self.said.and_then(|said| hdt(said.heading_deg)),
            self.said.and_then(|said| pnoff(said.sigma_deg, said.flags, said.mode)),
        ];
        sentences.iter().flatten().for_each(|sentence| say(sentence));
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
    use std::string::ToString as _;

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
    fn sigma_and_flags_have_a_sentence_of_their_own() {
        let flags = Flags::from_bits(1 << 20 | 1);
        assert!(pnoff(0.03804, flags, Mode::Autonomous).unwrap().starts_with("$PNOFF,0.0380,00100001,A*"));
        assert!(pnoff(1e9, flags, Mode::Estimated).unwrap().starts_with("$PNOFF,180.0000,00100001,E*"));
        assert_eq!(pnoff(f64::NAN, flags, Mode::Autonomous), None);
        // A heading of three digits, and all bits: within the longest sentence.
        assert!(pnoff(179.99, Flags::from_bits(u32::MAX), Mode::Simulator).unwrap().len() <= MAX_SENTENCE);
    }

    #[test]
    fn each_second_says_what_is_known() {
        let fix = Fix {
            azimuth_deg: 40.0,
            sigma_deg: 0.04,
            closure_deg_h: None,
            closure_sigma_deg_h: None,
            chi_square: 0.0,
            degrees_of_freedom: 0,
            bias_deg_h: 0.0,
            amplitude_deg_h: 12.0,
            drift_deg_h_per_h: 0.0,
            tilt: None,
            seconds: 240.0,
            flags: Flags::default(),
        };
        let held = |motion, refix| {
            let sigma_deg = 0.1;
            Heading { heading_deg: 41.0, pitch_deg: 0.0, roll_deg: 0.0, sigma_deg, sigma_level_deg: 0.0, motion, refix }
        };
        let second = Event::Second(crate::event::Second {
            t_s: 1.0,
            index_deg: None,
            fog_arcsec: 0.0,
            moment_arcsec_s: 0.0,
            rate_deg_h: 0.0,
            temp_c: None,
            block_temp_c: None,
            level_temp_c: None,
            auxiliary: [None; 6],
            level: None,
            lost_frames: 0,
            dwell: None,
            collected: false,
            waited_at: None,
        });
        let mut speaker = Speaker::default();
        let mut said = |event| {
            let mut said = std::string::String::new();
            speaker.hear(&Report { t_s: 0.0, event }, &mut |_| panic!("only seconds are told"));
            speaker.hear(&Report { t_s: 0.0, event: second }, &mut |sentence| said.push_str(sentence));
            said.lines().map(|line| line.split('*').next().unwrap().to_string()).collect::<std::vec::Vec<_>>()
        };
        assert_eq!(said(Event::State(State::Idle)), ["$HETHS,,V"]);
        let of_fix = ["$HETHS,40.0000,A", "$HEHDT,40.0000,T", "$PNOFF,0.0400,00000000,A"];
        assert_eq!(said(Event::Fix(fix)), of_fix);
        let of_hold = ["$HETHS,41.0000,E", "$HEHDT,41.0000,T", "$PNOFF,0.1000,00000000,E"];
        assert_eq!(said(Event::Heading(held(Motion::Moving, false))), of_hold);
        assert_eq!(said(Event::Heading(held(Motion::Standing, true))), ["$HETHS,,V"]);
        // While its accelerometers are calibrated the instrument is turned by hand.
        assert_eq!(said(Event::Fix(fix)), of_fix);
        assert_eq!(said(Event::State(State::Calibrating)), ["$HETHS,,V"]);
        assert_eq!(said(Event::Fix(fix)), of_fix);
        assert_eq!(said(Event::State(State::Levelling)), ["$HETHS,,V"]);
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

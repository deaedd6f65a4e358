//! The serial protocol between the instrument and a host: reports out, requests in.
//!
//! For those who implement the other side. The line is 8 data bits, no parity, 1 stop bit. In both directions the
//! bytes are a sequence of frames, each
//!
//! ```text
//! COBS( version, message, CRC-32 of version and message ) 00
//! ```
//!
//! - COBS (Cheshire and Baker 1999) replaces the zero bytes, so that 00 occurs nowhere but at the end of a frame.
//! - `version` is one byte, [`VERSION`]. A change of the messages changes it.
//! - `message` is a [`Report`] (instrument to host) or a [`Request`] (host to instrument) in postcard's encoding:
//!   fields in the order of their declaration and nothing between them; `f64` as 8 bytes, little-endian; `u8` and
//!   `bool` as a byte; other integers as LEB128 variable-length integers; `Option` as 00, or 01 and the value; the
//!   variant of an enum as its number from 0, a variable-length integer, and then its fields; a list as its length and
//!   its items.
//! - CRC-32 is the one of Ethernet and zlib (CRC-32/ISO-HDLC), 4 bytes, little-endian.
//!
//! Example: the report "at 2 s the state is idle" has the content `0A`, `00 00 00 00 00 00 00 40`, `00`, `00`, `A8 64 B2 F9`.
//! All messages: docs/link.md. The raw stream: [`crate::event::raw`].
//!
//! Where the settings say so (`link.nmea`), NMEA 0183 sentences stand between the frames, each with a 00 behind it: for a reader of sentences the
//! frames are noise between a line's end and a `$`, and a decoder of frames passes sentences over.
//!
//! Whoever receives drops what does not decode and counts it; after any disturbance the next 00 is the next chance. A
//! sender may send a 00 before a frame, to end whatever noise came before: an empty frame is not counted.

pub mod nmea;

use core::marker::PhantomData;

use heapless::Vec;
use north_boot::CRC_32;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::event::Report;
use crate::event::bytes::{Bytes, Piece};
use crate::event::restart::Provocation;
use crate::health::Refusal;
use crate::sequence::Command;

/// The first byte of every frame's content.
pub const VERSION: u8 = 10;

/// Bits a second on the host's line; ten of them are a byte.
pub const BAUD: u32 = 115_200;

/// Longest frame that holds a [`Report`], with its closing 00.
pub const MAX_REPORT: usize = 168;
/// Longest frame that holds a [`Request`], with its closing 00.
pub const MAX_REQUEST: usize = 128;

const CRC_LENGTH: usize = 4;

/// What a host asks of the instrument. The instrument answers every one with [`Event::Answer`](crate::event::Event::Answer), after
/// the reports that it leads to at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// The host's number of the request, 1 to 255: the answer repeats it.
    pub number: u8,
    pub ask: Ask,
}

/// What can be asked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// To the state machines of fix and calibration.
    Command(Command),
    /// Which firmware is this? [`Event::Identity`](crate::event::Event::Identity).
    Identify,
    /// What is it doing? The state and the counters, as they are reported when they change.
    Status,
    /// A piece of the settings in flash, with the model: [`Event::Settings`](crate::event::Event::Settings).
    ReadSettings { offset: u16 },
    /// A piece of settings, in order. After the last they are checked, kept in flash, and the instrument starts anew with them,
    /// whatever is under way. Refused while the motor turns.
    WriteSettings(Piece),
    /// The raw stream on, from the beginning of a second, or off: [`Event::Raw`](crate::event::Event::Raw).
    Stream(bool),
    /// Crash, to see that it is survived: the motor goes off, the instrument starts anew and tells of it. Or lag, to see that nothing
    /// is lost by it.
    Provoke(Provocation),
    /// Test yourself: [`Event::SelfTest`](crate::event::Event::SelfTest) for every item, within six seconds. The accelerometer is read in another
    /// range for half a second, and the index moves by 5° and back. Refused while a fix or a calibration is under way.
    SelfTest,
    /// A piece of an image, its manifest first, in order. After the last the instrument starts anew, with the image where it is signed. Refused while
    /// the motor turns, and while a fix or a calibration is under way.
    WriteImage { offset: u32, bytes: Bytes },
    /// Erase a sector of the free slot, the last one first, after the manifest and before the image: two seconds in which the processor
    /// stands still.
    EraseImage { sector: u8 },
    /// The time of day of the instrument's tick 0: seconds since 1970, UTC. It holds until the next start.
    SetClock { utc_s: f64 },
    /// The log of fixes from a place on, in the order of writing: [`Event::Log`](crate::event::Event::Log).
    ReadLog { from: u32 },
    /// The last fix was made at this surveyed azimuth, degrees.
    CheckFix { azimuth_deg: f64 },
    /// A challenge for [`Self::Unlock`]: [`Event::Challenge`](crate::event::Event::Challenge).
    Challenge,
    /// The last challenge, signed ([`crate::instrument::session`]): dangerous requests are served from now on. Refused while a fix or a calibration is under
    /// way: to check it takes tenths of a second.
    Unlock(Bytes),
    /// Dangerous requests are refused again.
    Lock,
}

impl From<Ask> for Request {
    fn from(ask: Ask) -> Self {
        Self { number: 1, ask }
    }
}

/// A frame of N bytes cannot hold the message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

/// A report as a frame.
pub fn encode_report(report: &Report) -> Result<Vec<u8, MAX_REPORT>, TooLong> {
    encode(report)
}

/// A request as a frame.
pub fn encode_request(request: &Request) -> Result<Vec<u8, MAX_REQUEST>, TooLong> {
    encode(request)
}

fn encode<const N: usize>(message: &impl Serialize) -> Result<Vec<u8, N>, TooLong> {
    let mut content = [0; N];
    let (version, rest) = content.split_first_mut().ok_or(TooLong)?;
    *version = VERSION;
    let length = 1 + postcard::to_slice(message, rest).map_err(|_| TooLong)?.len();
    let (checked, rest) = content.split_at_mut_checked(length).ok_or(TooLong)?;
    let crc = CRC_32.checksum(checked).to_le_bytes();
    rest.get_mut(..CRC_LENGTH).ok_or(TooLong)?.copy_from_slice(&crc);

    let content = content.get(..length + CRC_LENGTH).ok_or(TooLong)?;
    let mut frame = Vec::new();
    frame.resize(N, 0).map_err(|_| TooLong)?;
    let length = cobs::try_encode(content, &mut frame).map_err(|_| TooLong)?;
    frame.truncate(length);
    frame.push(0).map_err(|_| TooLong)?;
    Ok(frame)
}

/// Why a frame was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadFrame {
    /// Too long, not COBS, or of a wrong CRC.
    Damaged,
    /// Of another version of the link.
    OtherVersion,
    /// Not a message.
    NotUnderstood,
}

impl From<BadFrame> for Refusal {
    fn from(bad: BadFrame) -> Self {
        match bad {
            BadFrame::Damaged => Self::Damaged,
            BadFrame::OtherVersion => Self::OtherVersion,
            BadFrame::NotUnderstood => Self::NotUnderstood,
        }
    }
}

/// Turns received bytes into messages, whatever the bytes are. `N` is the longest frame.
#[derive(Clone, Debug)]
pub struct Decoder<M, const N: usize> {
    frame: Vec<u8, N>,
    overflowed: bool,
    message: PhantomData<M>,
}

/// A host's decoder.
pub type ReportDecoder = Decoder<Report, MAX_REPORT>;
/// The instrument's decoder.
pub type RequestDecoder = Decoder<Request, MAX_REQUEST>;

impl<M, const N: usize> Decoder<M, N> {
    pub const fn new() -> Self {
        Self { frame: Vec::new(), overflowed: false, message: PhantomData }
    }
}

impl<M, const N: usize> Default for Decoder<M, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<M: DeserializeOwned, const N: usize> Decoder<M, N> {
    /// Takes one byte; at the end of a frame gives its message, or says that the frame was bad.
    pub fn feed(&mut self, byte: u8) -> Option<Result<M, BadFrame>> {
        if byte != 0 {
            self.overflowed |= self.frame.push(byte).is_err();
            return None;
        }
        if self.frame.is_empty() {
            return None;
        }
        let sentence = self.frame.starts_with(b"$") && self.frame.ends_with(b"\r\n");
        let message = if self.overflowed { Err(BadFrame::Damaged) } else { decode(&mut self.frame) };
        self.frame.clear();
        self.overflowed = false;
        // A frame that looks like a sentence is one nevertheless, by its check sum.
        let noise = sentence && matches!(message, Err(BadFrame::Damaged));
        (!noise).then_some(message)
    }
}

/// The message in a frame without its closing 00; the frame is decoded in place.
fn decode<M: DeserializeOwned>(frame: &mut [u8]) -> Result<M, BadFrame> {
    let (version, message) = checked(frame).ok_or(BadFrame::Damaged)?;
    if version != VERSION {
        return Err(BadFrame::OtherVersion);
    }
    match postcard::take_from_bytes(message) {
        Ok((message, [])) => Ok(message),
        _ => Err(BadFrame::NotUnderstood),
    }
}

/// Version and message of a frame whose check sum is right.
fn checked(frame: &mut [u8]) -> Option<(u8, &[u8])> {
    let length = cobs::decode_in_place(frame).ok()?;
    let (checked, crc) = frame.get(..length)?.split_last_chunk::<CRC_LENGTH>()?;
    let (&version, message) = checked.split_first()?;
    (CRC_32.checksum(checked) == u32::from_le_bytes(*crc)).then_some((version, message))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec as StdVec;

    use proptest::prelude::*;

    use super::*;
    use crate::event::identity::{Board, Identity};
    use crate::event::raw::Block;
    use crate::event::restart::{Cause, Crash, Text};
    use crate::event::{Event, Fix, Second, State};
    use crate::health::{Counters, Finding, Flag, Flags, Item, Signal};
    use crate::sensing::gates::Gate;
    use crate::sensing::level::{LevelMoments, Specific, Tilt};
    use crate::settings::pieces::Outgoing;
    use crate::settings::store::longest;
    use calibration::accelerometer::AccelerometerCalibration;
    use calibration::field::problem::Solved;

    const TRIAD: AccelerometerCalibration = AccelerometerCalibration { bias_g: [1.1; 3], matrix: [1.1; 6] };

    fn idle() -> Report {
        Report { t_s: 2.0, event: Event::State(State::Idle) }
    }

    type Decoded<M> = StdVec<Result<M, BadFrame>>;

    fn feed<M: DeserializeOwned, const N: usize>(decoder: &mut Decoder<M, N>, bytes: &[u8]) -> Decoded<M> {
        bytes.iter().filter_map(|&byte| decoder.feed(byte)).collect()
    }

    #[test]
    fn the_example_of_the_documentation_byte_by_byte() {
        // Content 0A | 2.0 as f64 | 00 | 00, its CRC-32 from zlib's crc32(), and COBS by hand: every 00 becomes the
        // distance to the next one.
        let expected = [2, 10, 1, 1, 1, 1, 1, 1, 2, 0x40, 1, 5, 0xA8, 0x64, 0xB2, 0xF9, 0];
        let frame = encode_report(&idle()).unwrap();
        assert_eq!(frame[..], expected[..]);
        assert_eq!(feed(&mut ReportDecoder::new(), &frame), [Ok(idle())]);
    }

    #[test]
    #[expect(clippy::too_many_lines, reason = "every field of a report")]
    fn the_longest_report_fits() {
        let counters = Counters {
            frames_good: u32::MAX,
            frames_bad_crc: u32::MAX,
            frames_lost: u32::MAX,
            frames_duplicate: u32::MAX,
            frames_late: u32::MAX,
            frames_invalid: u32::MAX,
            bytes_skipped: u32::MAX,
            bytes_refused: u32::MAX,
            seconds_repaired: u32::MAX,
            seconds_left_out: u32::MAX,
            seconds_outlying: u32::MAX,
            accelerometer_errors: u32::MAX,
            encoder_errors: u32::MAX,
            block_errors: u32::MAX,
            block_missed: u32::MAX,
            block_saturated: u32::MAX,
            readings_refused: u32::MAX,
            reports_refused: u32::MAX,
            commands_bad: u32::MAX,
            gyro_overruns: u32::MAX,
            gyro_framing_errors: u32::MAX,
            gyro_noise_errors: u32::MAX,
            host_overruns: u32::MAX,
            host_framing_errors: u32::MAX,
            host_noise_errors: u32::MAX,
            host_bytes_refused: u32::MAX,
            ticks_late: u32::MAX,
            ticks_lost: u32::MAX,
            fixes_not_logged: u32::MAX,
        };
        let specific = Specific { forward: 1.1, left: 1.1 };
        let second = Second {
            t_s: 1.1,
            index_deg: Some(1.1),
            fog_arcsec: 1.1,
            moment_arcsec_s: 1.1,
            rate_deg_h: 1.1,
            temp_c: Some(1.1),
            block_temp_c: Some(1.1),
            level_temp_c: Some(1.1),
            auxiliary: [Some(1.1); 6],
            level: Some(LevelMoments { mean: specific, first: specific }),
            lost_frames: u16::MAX,
            dwell: Some(255),
            collected: true,
            waited_at: Some(Gate::Jitter),
        };
        let mut flags = Flags::default();
        flags.insert(Flag::NoRedundancy);
        let fix = Fix {
            azimuth_deg: 1.1,
            sigma_deg: 1.1,
            closure_deg_h: Some(1.1),
            closure_sigma_deg_h: Some(1.1),
            chi_square: 1.1,
            degrees_of_freedom: u16::MAX,
            bias_deg_h: 1.1,
            amplitude_deg_h: 1.1,
            drift_deg_h_per_h: 1.1,
            tilt: Some(Tilt { pitch_deg: 1.1, roll_deg: 1.1 }),
            seconds: 1.1,
            flags,
        };
        let solved = Solved {
            attitudes: 18,
            judged: 6,
            left_out: 0,
            coverage: 1.1,
            before_g: 1.1,
            after_g: 1.1,
            judged_before_g: 1.1,
            judged_after_g: 1.1,
            evidence: 1.1,
            calibration: TRIAD,
        };
        let crash = Crash {
            program_counter: u32::MAX,
            link_register: u32::MAX,
            stack_pointer: u32::MAX,
            fault_status: u32::MAX,
            program: u32::MAX,
            line: u32::MAX,
            ..Crash::new(Cause::Clock)
        };
        let events = [
            Event::Health(counters),
            Event::Second(second),
            Event::Fix(fix),
            Event::Calibration(solved),
            Event::Crash(crash),
            Event::Raw(Block { number: 255, bytes: Bytes::start_of(&[255; 96]) }),
            Event::Log { next: u32::MAX, bytes: Bytes::start_of(&[255; 96]) },
            Event::ModelAged { signal: Signal::AzimuthError, statistic: 1.1 },
            Event::Violation { field: Text::start_of(&"x".repeat(40)), value: 1.1 },
            Event::Answer { number: 255, refusal: Some(Refusal::SettingsCorrupt) },
            Event::Identity(Identity {
                free_slot: u32::MAX,
                ..Identity::new(Board::Stm32f405, u32::MAX, [u32::MAX; 3])
            }),
            Event::SelfTest(Finding::judged(Item::Drive, 1.1, [1.1; 2])),
        ];
        for event in events {
            let report = Report { t_s: 1.1, event };
            let frame = encode_report(&report).unwrap();
            assert_eq!(feed(&mut ReportDecoder::new(), &frame), [Ok(report)]);
        }
    }

    #[test]
    fn the_longest_pieces_of_settings_fit() {
        let pieces: StdVec<Piece> = Outgoing::new(&longest::settings()).unwrap().collect();
        for piece in pieces {
            let piece = Piece { version: u16::MAX, length: u16::MAX, offset: u16::MAX, ..piece };
            let request = Request { number: 255, ask: Ask::WriteSettings(piece) };
            let frame = encode_request(&request).unwrap();
            assert_eq!(feed(&mut RequestDecoder::new(), &frame), [Ok(request)]);
            let report = Report { t_s: 1.1, event: Event::Settings(piece) };
            let frame = encode_report(&report).unwrap();
            assert_eq!(feed(&mut ReportDecoder::new(), &frame), [Ok(report)]);
        }
    }

    #[test]
    fn another_version_is_refused() {
        let mut frame = encode_report(&idle()).unwrap();
        let length = cobs::decode_in_place(&mut frame[..16]).unwrap();
        frame[0] = VERSION + 1;
        let crc = CRC_32.checksum(&frame[..length - 4]).to_le_bytes();
        frame[length - 4..length].copy_from_slice(&crc);
        let mut again = [0; 32];
        let length = cobs::encode(&frame[..length], &mut again);
        assert_eq!(feed(&mut ReportDecoder::new(), &again[..=length]), [Err(BadFrame::OtherVersion)]);
    }

    #[test]
    fn empty_frames_are_nothing() {
        assert_eq!(feed(&mut ReportDecoder::new(), &[0, 0, 0]), []);
    }

    #[test]
    fn sentences_between_frames_are_passed_over() {
        let frame = encode_report(&idle()).unwrap();
        let bytes = [&frame[..], b"$HETHS,,V*14\r\n\0", &frame, b"$HETHS,,V*14\0", &frame].concat();
        let decoded = feed(&mut ReportDecoder::new(), &bytes);
        assert_eq!(decoded, [Ok(idle()), Ok(idle()), Err(BadFrame::Damaged), Ok(idle())]);
    }

    #[test]
    fn a_frame_without_end_is_one_bad_frame() {
        let mut decoder = ReportDecoder::new();
        assert_eq!(feed(&mut decoder, &[7; 10_000]), []);
        let mut rest = StdVec::from([0]);
        rest.extend(encode_report(&idle()).unwrap());
        assert_eq!(feed(&mut decoder, &rest), [Err(BadFrame::Damaged), Ok(idle())]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived_and_the_next_frame_is_read(noise: StdVec<u8>) {
            let mut decoder = ReportDecoder::new();
            feed(&mut decoder, &noise);
            feed(&mut decoder, &[0]);
            let frame = encode_report(&idle()).unwrap();
            prop_assert_eq!(feed(&mut decoder, &frame), [Ok(idle())]);
        }

        #[test]
        fn a_changed_byte_is_never_accepted(at in 0_usize..16, change in 1_u8..=255) {
            let mut frame = encode_report(&idle()).unwrap();
            frame[at] ^= change;
            let decoded = feed(&mut ReportDecoder::new(), &frame);
            prop_assert!(!decoded.is_empty() && decoded.iter().all(Result::is_err));
        }
    }
}

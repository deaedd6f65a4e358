//! Gyro bytes to checked frames.
//!
//! A frame is accepted only if its check sum is right. After any corruption the search starts again one byte further
//! on, inside the bytes already received, so that no good frame that follows is ever lost to a false header.
//!
//! Two formats:
//!
//! | | compact (little-endian, 14 bytes) | KVH format A (big-endian, 36 bytes) |
//! |---|---|---|
//! | header | `A5 5A` | `FE 81 FF 55` |
//! | sequence | byte 2, 0-255 | byte 29, 0-127 |
//! | status | byte 3: bit 0 valid, 1 saturated, 2 temperature valid | byte 28: bit 0 x gyro valid |
//! | increment | bytes 4-7, i32, 1e-6 arcsec | bytes 4-7, f32, radians (x axis, delta angle) |
//! | temperature | bytes 8-9, i16, 0.01 °C | bytes 30-31, i16, °C |
//! | CRC-32 | bytes 10-13 over 0-9 | bytes 32-35 over 0-31 |
//!
//! CRC-32 in both: polynomial 04C11DB7, initial FFFFFFFF, not reflected, no final xor (in the catalogue of
//! parametrised CRC algorithms: CRC-32/MPEG-2). KVH format A: KVH 1750 IMU technical manual, 56-0315.

pub mod kvh;
pub mod setup;

use crc::{CRC_32_MPEG_2 as MPEG_2, Crc, Table};
use serde::{Deserialize, Serialize};

use self::kvh::KvhFrame;
use crate::units::ARCSEC_PER_RAD;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&MPEG_2);
const LONGEST: usize = 36;
/// Bytes that are looked at together: the beginning of a frame, and a tick's.
const CAPACITY: usize = 80;
/// Counts that KVH's radians are turned into: 400 samples at the largest range, weighted for the first moment, fit an `i64`.
const KVH_COUNTS_PER_RAD: u64 = 1 << 48;

/// Which frames the gyro sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[serde(rename_all = "kebab-case")]
pub enum GyroFormat {
    /// The project's own 14-byte single-axis frame.
    Compact,
    /// KVH format A, delta angle in radians; the x axis is the one that is used.
    KvhA,
}

/// What one frame of the gyro says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Counts the gyro's frames modulo [`GyroFormat::sequence_modulus`].
    pub sequence: u8,
    /// Angle over the sample interval, right-handed about the sensitive axis, in counts of
    /// [`GyroFormat::arcsec_per_count`]: whole numbers, whose sums are exact and quick.
    pub increment: i64,
    /// Gyro temperature, in counts of [`GyroFormat::c_per_count`].
    pub temperature: Option<i16>,
    /// The gyro vouches for the increment, and it is a finite number.
    pub valid: bool,
    /// The rate was beyond the gyro's range.
    pub saturated: bool,
}

impl GyroFormat {
    /// Bytes in a frame.
    pub const fn length(self) -> usize {
        match self {
            Self::Compact => 14,
            Self::KvhA => LONGEST,
        }
    }

    /// Sequence numbers run from 0 to this minus one.
    pub const fn sequence_modulus(self) -> u16 {
        match self {
            Self::Compact => 256,
            Self::KvhA => 128,
        }
    }

    /// Arcseconds of a count of [`Frame::increment`]. KVH's floating-point radians are cut to 2⁻⁴⁸ rad: below 1e-9 arcsec.
    pub const fn arcsec_per_count(self) -> f64 {
        match self {
            Self::Compact => 1e-6,
            Self::KvhA => ARCSEC_PER_RAD / KVH_COUNTS_PER_RAD as f64,
        }
    }

    /// Degrees Celsius of a count of [`Frame::temperature`].
    pub const fn c_per_count(self) -> f64 {
        match self {
            Self::Compact => 0.01,
            Self::KvhA => 1.0,
        }
    }

    const fn header(self) -> &'static [u8] {
        match self {
            Self::Compact => &[0xA5, 0x5A],
            Self::KvhA => &[0xFE, 0x81, 0xFF, 0x55],
        }
    }

    /// The frame in `bytes`, which have the format's length and header; `None` if the check sum is wrong.
    fn decode(self, bytes: &[u8]) -> Option<Frame> {
        match self {
            Self::Compact => {
                let content = checked(bytes, u32::from_le_bytes)?;
                let &[_, _, sequence, status, i0, i1, i2, i3, t0, t1] = content else { return None };
                Some(Frame {
                    sequence,
                    increment: i32::from_le_bytes([i0, i1, i2, i3]).into(),
                    temperature: (status & 4 != 0).then_some(i16::from_le_bytes([t0, t1])),
                    valid: status & 1 != 0,
                    saturated: status & 2 != 0,
                })
            }
            Self::KvhA => {
                let frame = KvhFrame::decode(bytes)?;
                let [x, _, _] = frame.gyro;
                Some(Frame {
                    sequence: frame.sequence,
                    // A product with a power of two is exact; beyond the integers' range, and of no number, `as` saturates.
                    increment: (x * KVH_COUNTS_PER_RAD as f32) as i64,
                    temperature: Some(frame.temp_c),
                    valid: frame.gyro_valid(0),
                    saturated: false,
                })
            }
        }
    }
}

/// The content of a frame whose check sum, its last four bytes as `number` reads them, is right.
fn checked(bytes: &[u8], number: fn([u8; 4]) -> u32) -> Option<&[u8]> {
    let (content, check) = bytes.split_last_chunk::<4>()?;
    (check_sum(content) == number(*check)).then_some(content)
}

/// As the crate's own, which looks at the algorithm's properties while it runs: that takes twice as many instructions.
fn check_sum(bytes: &[u8]) -> u32 {
    let [table] = CRC.table();
    bytes.iter().fold(MPEG_2.init, |sum, byte| {
        let [most, ..] = sum.to_be_bytes();
        sum << 8 ^ table.get(usize::from(most ^ byte)).copied().unwrap_or_default()
    })
}

/// Finds frames in a stream of bytes.
#[derive(Clone, Debug)]
pub struct FrameReader {
    format: GyroFormat,
    /// From `begin` to `end`: what was not looked at, or is the beginning of a frame.
    bytes: [u8; CAPACITY],
    begin: usize,
    end: usize,
    bad_crc: u32,
    bytes_skipped: u32,
}

impl FrameReader {
    pub fn new(format: GyroFormat) -> Self {
        Self { format, bytes: [0; CAPACITY], begin: 0, end: 0, bad_crc: 0, bytes_skipped: 0 }
    }

    /// Takes bytes from `source`, which puts them into the place that it gets and says how many; gives that number. There is room
    /// once [`Self::next`] has no frame any more.
    pub fn fill(&mut self, source: impl FnOnce(&mut [u8]) -> usize) -> usize {
        if self.begin > 0 {
            self.bytes.copy_within(self.begin..self.end, 0);
            (self.begin, self.end) = (0, self.end - self.begin);
        }
        let place = self.bytes.get_mut(self.end..).unwrap_or_default();
        let room = place.len();
        let length = source(place).min(room);
        self.end += length;
        length
    }

    /// The next frame in what was taken.
    #[allow(clippy::should_implement_trait)] // there are more after the next filling
    pub fn next(&mut self) -> Option<Frame> {
        let format = self.format;
        self.next_with(|bytes| format.decode(bytes))
    }

    /// Takes the next byte; gives the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Frame> {
        self.put(byte);
        self.next()
    }

    fn put(&mut self, byte: u8) {
        self.fill(|place| place.iter_mut().take(1).map(|place| *place = byte).count());
    }

    /// [`Self::next`] with another reading of the format's bytes.
    fn next_with<T>(&mut self, decode: impl Fn(&[u8]) -> Option<T>) -> Option<T> {
        loop {
            let bytes = self.bytes.get(self.begin..self.end).filter(|bytes| !bytes.is_empty());
            let Some(bytes) = bytes else {
                (self.begin, self.end) = (0, 0);
                return None;
            };
            if bytes.iter().zip(self.format.header()).all(|(byte, expected)| byte == expected) {
                let length = self.format.length();
                if let Some(frame) = decode(bytes.get(..length)?) {
                    self.begin += length;
                    return Some(frame);
                }
                self.bad_crc = self.bad_crc.saturating_add(1);
            }
            self.begin += 1;
            self.bytes_skipped = self.bytes_skipped.saturating_add(1);
        }
    }

    /// Frames with a wrong check sum so far, false headers included.
    pub fn bad_crc(&self) -> u32 {
        self.bad_crc
    }

    /// Bytes that belong to no good frame so far.
    pub fn bytes_skipped(&self) -> u32 {
        self.bytes_skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::io::Read;

    // Test vectors of public drivers of the KVH 1750 family; their check sums were recomputed.
    const GOOD: [[u8; 36]; 2] = [
        [
            0xFE, 0x81, 0xFF, 0x55, 0x37, 0xA9, 0x6A, 0x6E, 0x38, 0x58, 0x6C, 0x1F, 0xB7, 0x5B, 0xF8, 0x62, 0xBF, 0x80,
            0x3E, 0x78, 0xBB, 0x65, 0x0D, 0x28, 0x3B, 0x0A, 0x37, 0xAC, 0x77, 0x3D, 0x00, 0x28, 0x4B, 0xFA, 0x34, 0xD8,
        ],
        [
            0xFE, 0x81, 0xFF, 0x55, 0xB3, 0xD0, 0xBB, 0xE7, 0x32, 0x19, 0x3E, 0xF4, 0x30, 0xAC, 0x19, 0xA5, 0xBA, 0x8F,
            0x78, 0xD6, 0x3A, 0x29, 0x05, 0x94, 0x3F, 0x7E, 0xCB, 0xD4, 0x77, 0x68, 0x00, 0x1D, 0xAD, 0xC5, 0xF6, 0x51,
        ],
    ];
    const BAD: [u8; 36] = [
        0xFE, 0x81, 0xFF, 0x55, 0xB4, 0x6B, 0x86, 0xC6, 0xB4, 0x4F, 0x5B, 0x83, 0xB4, 0x10, 0x6D, 0x09, 0xBB, 0x71,
        0x3C, 0xB7, 0xBB, 0xAB, 0xD9, 0x14, 0x3F, 0x7E, 0x31, 0x9A, 0x77, 0x69, 0x00, 0x1D, 0x95, 0xBB, 0xDB, 0x4F,
    ];

    /// Byte by byte; and the same in pieces.
    fn read(format: GyroFormat, bytes: &[u8]) -> (std::vec::Vec<Frame>, FrameReader) {
        let mut reader = FrameReader::new(format);
        let frames: std::vec::Vec<_> = bytes.iter().filter_map(|&byte| reader.push(byte)).collect();
        for length in [bytes.len(), 7, 40] {
            let mut of_pieces = FrameReader::new(format);
            let mut found = std::vec::Vec::new();
            for mut piece in bytes.chunks(length) {
                while !piece.is_empty() {
                    of_pieces.fill(|place| piece.read(place).unwrap());
                    found.extend(core::iter::from_fn(|| of_pieces.next()));
                }
            }
            assert_eq!(found, frames);
            assert_eq!((of_pieces.bad_crc(), of_pieces.bytes_skipped()), (reader.bad_crc(), reader.bytes_skipped()));
        }
        (frames, reader)
    }

    #[test]
    fn kvh_vectors() {
        let (frames, reader) = read(GyroFormat::KvhA, GOOD.as_flattened());
        assert_eq!(frames.len(), 2);
        // 0x37A96A6E as a float is 2.0196e-5 rad, that is 4.1657 arcsec; sequence 0x3D, temperature 0x28 = 40 °C.
        let increment_arcsec = frames[0].increment as f64 * GyroFormat::KvhA.arcsec_per_count();
        assert!((increment_arcsec - 4.1657).abs() < 1e-3, "{increment_arcsec}");
        // Exactly: 2^(111−127) · (1 + 0x296A6E/2^23) = 0xA96A6E · 2^−39 rad, so 0xA96A6E · 2^9 counts of 2^−48 rad.
        assert_eq!(frames[0].increment, 0xA96A6E << 9);
        assert_eq!((frames[0].sequence, frames[0].temperature, frames[0].valid), (0x3D, Some(40), true));
        assert_eq!((frames[1].sequence, frames[1].temperature), (0x68, Some(29)));
        assert_eq!((reader.bad_crc(), reader.bytes_skipped()), (0, 0));
    }

    #[test]
    fn a_bad_check_sum_is_counted_and_the_next_frame_is_taken() {
        let stream: std::vec::Vec<u8> = [BAD, GOOD[0]].concat();
        let (frames, reader) = read(GyroFormat::KvhA, &stream);
        assert_eq!(frames.len(), 1);
        assert_eq!((reader.bad_crc(), reader.bytes_skipped()), (1, 36));
    }

    #[test]
    fn compact_frame_by_hand() {
        // Sequence 7, valid with temperature, 37603 micro-arcsec (Earth rate over 2.5 ms), 21.50 °C; the check
        // sum was computed apart from this program, bit by bit.
        let content = [0xA5, 0x5A, 7, 0b101, 0xE3, 0x92, 0, 0, 0x66, 0x08];
        let check = 0x51C5_B8E0_u32.to_le_bytes();
        let stream: std::vec::Vec<u8> = content.iter().chain(&check).copied().collect();
        let (frames, _) = read(GyroFormat::Compact, &stream);
        assert_eq!(
            frames,
            [Frame { sequence: 7, increment: 37603, temperature: Some(2150), valid: true, saturated: false }]
        );
    }

    #[test]
    fn a_false_header_hides_no_good_frame() {
        let mut stream = std::vec![0xFE, 0x81, 0xFF, 0x55, 1, 2, 3, 0xFE, 0x81];
        stream.extend_from_slice(&GOOD[1]);
        let (frames, reader) = read(GyroFormat::KvhA, &stream);
        assert_eq!((frames.len(), frames[0].sequence), (1, 0x68));
        assert_eq!((reader.bad_crc(), reader.bytes_skipped()), (1, 9));
    }
}

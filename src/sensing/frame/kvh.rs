//! Everything in a frame of KVH format A: three gyros, three accelerometers. The instrument needs only one of them;
//! recordings of a whole triad are read with this.

use super::GyroFormat;
use super::{FrameReader, checked};

/// Accelerometers begin at this bit of the status.
const ACCELEROMETER_BITS: usize = 4;

/// A frame whose check sum is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KvhFrame {
    /// X, Y, Z, right-handed: delta angle or rate, radians or degrees; how the gyro was configured is not in the frame.
    pub gyro: [f32; 3],
    /// X, Y, Z, specific force; reserved on models that have gyros only.
    pub acceleration_g: [f32; 3],
    /// Bits 0-2: the gyros, bits 4-6: the accelerometers; 1 is valid.
    pub status: u8,
    /// Counts frames modulo 128.
    pub sequence: u8,
    /// °C.
    pub temp_c: i16,
}

impl KvhFrame {
    /// `bytes` have the format's length; `None` if the check sum is wrong.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let content = checked(bytes, u32::from_be_bytes)?;
        let float = |at: usize| Some(f32::from_be_bytes(*content.get(at..)?.first_chunk::<4>()?));
        let &[status, sequence, t0, t1] = content.last_chunk::<4>()?;
        Some(Self {
            gyro: [float(4)?, float(8)?, float(12)?],
            acceleration_g: [float(16)?, float(20)?, float(24)?],
            status,
            sequence: sequence & 0x7F,
            temp_c: i16::from_be_bytes([t0, t1]),
        })
    }

    /// Whether a gyro (0 to 2: X, Y, Z) vouches for its number, and it is one.
    pub fn gyro_valid(&self, axis: usize) -> bool {
        self.valid(axis) && self.gyro.get(axis).is_some_and(|value| value.is_finite())
    }

    /// Whether an accelerometer (0 to 2: X, Y, Z) vouches for its number, and it is one.
    pub fn acceleration_valid(&self, axis: usize) -> bool {
        self.valid(axis + ACCELEROMETER_BITS) && self.acceleration_g.get(axis).is_some_and(|value| value.is_finite())
    }

    fn valid(&self, bit: usize) -> bool {
        (self.status >> bit) & 1 == 1
    }
}

/// Finds whole frames of KVH format A in a stream of bytes, as [`FrameReader`] finds those of one axis.
#[derive(Clone, Debug)]
pub struct KvhReader(FrameReader);

impl Default for KvhReader {
    fn default() -> Self {
        Self(FrameReader::new(GyroFormat::KvhA))
    }
}

impl KvhReader {
    /// Takes the next byte; gives the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<KvhFrame> {
        self.0.put(byte);
        self.0.next_with(KvhFrame::decode)
    }

    /// Frames with a wrong check sum so far, false headers included.
    pub fn bad_crc(&self) -> u32 {
        self.0.bad_crc()
    }

    /// Bytes that belong to no good frame so far.
    pub fn bytes_skipped(&self) -> u32 {
        self.0.bytes_skipped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_public_vector() {
        // A vector of public drivers of the KVH 1750 family; the numbers were worked out by hand from the bits.
        let bytes: [u8; 36] = [
            0xFE, 0x81, 0xFF, 0x55, 0xB3, 0xD0, 0xBB, 0xE7, 0x32, 0x19, 0x3E, 0xF4, 0x30, 0xAC, 0x19, 0xA5, 0xBA, 0x8F,
            0x78, 0xD6, 0x3A, 0x29, 0x05, 0x94, 0x3F, 0x7E, 0xCB, 0xD4, 0x77, 0x68, 0x00, 0x1D, 0xAD, 0xC5, 0xF6, 0x51,
        ];
        let mut reader = KvhReader::default();
        let frame = bytes.iter().find_map(|&byte| reader.push(byte)).unwrap();
        let close = |value: f32, expected: f32| assert!((value / expected - 1.0).abs() < 1e-4, "{value}, {expected}");
        // 0xB3D0BBE7: −2^(103−127) · (1 + 0x50BBE7/2^23).
        close(frame.gyro[0], -9.7201e-8);
        close(frame.gyro[1], 8.9202e-9);
        close(frame.gyro[2], 1.2522e-9);
        close(frame.acceleration_g[0], -1.09460e-3);
        close(frame.acceleration_g[1], 6.44766e-4);
        close(frame.acceleration_g[2], 0.995298);
        assert_eq!((frame.status, frame.sequence, frame.temp_c), (0x77, 0x68, 29));
        assert!((0..3).all(|axis| frame.gyro_valid(axis) && frame.acceleration_valid(axis)));
        assert!(!frame.gyro_valid(3), "bit 3 is not a gyro's");
        assert_eq!((reader.bad_crc(), reader.bytes_skipped()), (0, 0));
    }

    #[test]
    fn what_is_not_a_number_is_not_valid() {
        let frame =
            KvhFrame { gyro: [f32::NAN, 0.0, 0.0], acceleration_g: [0.0; 3], status: 0x35, sequence: 0, temp_c: 0 };
        assert_eq!([0, 1, 2].map(|axis| frame.gyro_valid(axis)), [false, false, true]);
        assert_eq!([0, 1, 2].map(|axis| frame.acceleration_valid(axis)), [true, true, false]);
    }
}

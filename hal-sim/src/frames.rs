//! The gyro's frames, written from the description of the formats, with a CRC of their own.

use crate::geometry::ARCSEC_PER_RAD;
use crate::kvh_console::Output;
use crate::scenario::GyroFormat;

/// The content of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Angle increment, units of 1e-6 arcsec.
    pub increment_uas: i32,
    /// Temperature, °C.
    pub temp_c: f64,
    /// Counter, wraps at 256 (compact) or 128 (KVH).
    pub sequence: u8,
    /// The increment can be used.
    pub valid: bool,
    /// The rate was beyond full scale.
    pub saturated: bool,
    /// The temperature can be used.
    pub temp_valid: bool,
}

/// CRC-32 with polynomial 04C11DB7, initial FFFFFFFF, most significant bit first, no final xor; bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut register = u32::MAX;
    for byte in bytes {
        for bit in (0..8).rev() {
            let feedback = (register >> 31) ^ u32::from(byte >> bit & 1);
            register <<= 1;
            if feedback == 1 {
                register ^= 0x04C1_1DB7;
            }
        }
    }
    register
}

impl Frame {
    /// The frame's bytes, of a gyro that is set to increments in radians.
    pub fn encode(&self, format: GyroFormat) -> Vec<u8> {
        match format {
            GyroFormat::Compact => self.compact(),
            GyroFormat::KvhA => self.kvh_a(1.0),
        }
    }

    /// The frame's bytes, of an interval of so many seconds and as the gyro is set.
    pub(crate) fn encode_as(&self, format: GyroFormat, output: Output, interval_s: f64) -> Vec<u8> {
        match format {
            GyroFormat::Compact => self.compact(),
            GyroFormat::KvhA => {
                let per_radian = if output.degrees { 1_f64.to_degrees() } else { 1.0 };
                self.kvh_a(if output.rates { per_radian / interval_s } else { per_radian })
            }
        }
    }

    /// 14 bytes, little-endian: A5 5A, sequence, status, increment, temperature in 0.01 °C, CRC.
    fn compact(&self) -> Vec<u8> {
        let status = u8::from(self.valid) | u8::from(self.saturated) << 1 | u8::from(self.temp_valid) << 2;
        let mut bytes = vec![0xA5, 0x5A, self.sequence, status];
        bytes.extend(self.increment_uas.to_le_bytes());
        bytes.extend(((self.temp_c * 100.0).round() as i16).to_le_bytes());
        bytes.extend(crc32(&bytes).to_le_bytes());
        bytes
    }

    /// 36 bytes, big-endian: the axis on X, its angle in radians times `factor`. There is no status for saturation: the axis is
    /// marked as not valid.
    fn kvh_a(&self, factor: f64) -> Vec<u8> {
        let number = (f64::from(self.increment_uas) * 1e-6 / ARCSEC_PER_RAD * factor) as f32;
        let status = 0x76 | u8::from(self.valid && !self.saturated);
        let temp_c = if self.temp_valid { self.temp_c.round() as i16 } else { i16::MIN };
        kvh_a([number, 0.0, 0.0], [0.0; 3], status, self.sequence & 0x7F, temp_c)
    }
}

/// A frame of KVH format A.
pub fn kvh_a(angles: [f32; 3], accelerations_g: [f32; 3], status: u8, sequence: u8, temp_c: i16) -> Vec<u8> {
    let mut bytes = vec![0xFE, 0x81, 0xFF, 0x55];
    for number in angles.into_iter().chain(accelerations_g) {
        bytes.extend(number.to_be_bytes());
    }
    bytes.extend([status, sequence]);
    bytes.extend(temp_c.to_be_bytes());
    bytes.extend(crc32(&bytes).to_be_bytes());
    bytes
}

//! Numbers as bits of a record, each number's lowest first.

use crc::{CRC_16_IBM_SDLC, Crc, NoTable};

/// Bytes of a record.
pub const LENGTH: usize = 32;
const CONTENT: usize = LENGTH - 2;
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_SDLC);

/// Numbers that are kept in equal steps: a count of so many bits, of steps of 1/`per_unit`, from `least` steps on.
pub struct Steps {
    pub bits: u32,
    pub per_unit: f32,
    pub least: i32,
}

/// Bits of a ratio, its steps in an octave, and its step for 1.
const RATIO_BITS: u32 = 12;
const OCTAVE: f32 = 128.0;
const RATIO_OF_ONE: f32 = 2048.0;

/// A record that is written.
#[derive(Default)]
pub struct Writer {
    bytes: [u8; LENGTH],
    /// Bits that are written.
    at: u32,
}

impl Writer {
    /// The lowest bits of a number.
    pub fn bits(&mut self, number: u32, count: u32) {
        for bit in 0..count {
            if let Some(byte) = self.bytes.get_mut((self.at / 8) as usize) {
                *byte |= ((number >> bit & 1) as u8) << (self.at % 8);
            }
            self.at += 1;
        }
    }

    pub fn bytes(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.bits((*byte).into(), 8));
    }

    /// The highest bits of a number, rounded.
    pub fn float(&mut self, number: f32, count: u32) {
        let cut = 32 - count;
        self.bits(number.to_bits().saturating_add(1 << (cut - 1)) >> cut, count);
    }

    /// From 2⁻¹⁶ to 2¹⁶, within half a step of 1/128 of an octave: 0.3 %.
    pub fn ratio(&mut self, number: f32) {
        let step = libm::roundf(RATIO_OF_ONE + OCTAVE * libm::log2f(number)) as u32;
        // Of nothing the logarithm is none.
        self.bits(if number > 0.0 { step.clamp(1, (1 << RATIO_BITS) - 1) } else { 0 }, RATIO_BITS);
    }

    pub fn count(&mut self, value: Option<f32>, steps: &Steps) {
        let of = |value: f32| (libm::roundf(value * steps.per_unit) as i32).saturating_sub(steps.least);
        self.bits(value.map_or(0, |value| of(value).clamp(0, (1 << steps.bits) - 2) as u32 + 1), steps.bits);
    }

    /// With the check sum.
    pub fn finish(mut self) -> [u8; LENGTH] {
        let check = CRC.checksum(self.bytes.get(..CONTENT).unwrap_or_default());
        self.at = 8 * CONTENT as u32;
        self.bits(check.into(), 16);
        self.bytes
    }
}

/// A record that is read.
pub struct Reader<'a> {
    bytes: &'a [u8],
    /// Bits that are read.
    at: u32,
}

impl<'a> Reader<'a> {
    /// Of a record whose check sum is right.
    pub fn checked(bytes: &'a [u8; LENGTH]) -> Option<Self> {
        let (content, check) = bytes.split_last_chunk::<2>()?;
        (CRC.checksum(content) == u16::from_le_bytes(*check)).then_some(Self { bytes: content, at: 0 })
    }

    /// Zeros beyond the end.
    pub fn bits(&mut self, count: u32) -> u32 {
        let mut number = 0;
        for bit in 0..count {
            let byte = self.bytes.get((self.at / 8) as usize).copied().unwrap_or(0);
            number |= u32::from(byte >> (self.at % 8) & 1) << bit;
            self.at += 1;
        }
        number
    }

    pub fn bytes<const N: usize>(&mut self) -> [u8; N] {
        core::array::from_fn(|_| self.bits(8) as u8)
    }

    pub fn float(&mut self, count: u32) -> f32 {
        f32::from_bits(self.bits(count) << (32 - count))
    }

    pub fn ratio(&mut self) -> f32 {
        match self.bits(RATIO_BITS) {
            0 => 0.0,
            step => libm::exp2f((step as f32 - RATIO_OF_ONE) / OCTAVE),
        }
    }

    pub fn count(&mut self, steps: &Steps) -> Option<f32> {
        let count = self.bits(steps.bits).checked_sub(1)?;
        Some((count as i32 + steps.least) as f32 / steps.per_unit)
    }
}

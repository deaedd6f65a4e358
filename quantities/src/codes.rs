//! Readings of encoder and accelerometers as whole numbers: at every tick they are only added up, exactly and quickly, and become
//! degrees and g once a second.

use serde::{Deserialize, Serialize};

use crate::units::wrap_360_deg;

/// A reading of the encoder: index angle, counter-clockwise from above, in 2⁻³² of a turn. Exact for encoders of up to 32 bits,
/// and it wraps where the angle does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IndexCode(pub u32);

impl IndexCode {
    /// A power of two times 45: codes of up to 47 bits are exact in degrees.
    pub const DEG_PER_COUNT: f64 = 360.0 / 4_294_967_296.0;

    /// Of an angle, degrees.
    pub fn of_deg(index_deg: f64) -> Self {
        Self(libm::round(wrap_360_deg(index_deg) / Self::DEG_PER_COUNT) as u64 as u32)
    }

    /// Degrees in [0°, 360°).
    pub fn deg(self) -> f64 {
        f64::from(self.0) * Self::DEG_PER_COUNT
    }

    /// The shorter way from another angle to this one, counts.
    pub fn way_from(self, other: Self) -> i64 {
        self.0.wrapping_sub(other.0).cast_signed().into()
    }
}

/// A reading of the accelerometers as they give it: specific force, x forward, y left, z up; 2³¹ counts are 2.048 g, so that
/// readings of up to 32 bits of that range are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriadCode(pub [i32; 3]);

impl TriadCode {
    pub const COUNTS_PER_G: f64 = 2_147_483_648.0 / 2.048;
    /// Of a `Due::Response`: a difference of two readings in a range four times as wide.
    pub const RESPONSE_COUNTS_PER_G: f32 = 2_147_483_648.0 / 16.384;

    /// Of a reading in g; `None`: beyond the range, or not a number.
    pub fn of_g(acceleration_g: [f64; 3]) -> Option<Self> {
        let counts = acceleration_g.map(|g| libm::round(g * Self::COUNTS_PER_G));
        let in_range = counts.iter().all(|count| (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(count));
        in_range.then_some(Self(counts.map(|count| count as i32)))
    }

    /// In g.
    pub fn g(self) -> [f64; 3] {
        self.0.map(|count| f64::from(count) / Self::COUNTS_PER_G)
    }
}

/// A reading of the accelerometers' thermometer. It is linear and not adjusted: what it says of a change is good, of the temperature to some kelvins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriadTemperature(pub u16);

impl TriadTemperature {
    /// Typical (ADXL354/ADXL355 data sheet, revision B, "Temperature sensor"): it falls as the temperature rises.
    const COUNTS_AT_25_C: f64 = 1885.0;
    const COUNTS_PER_K: f64 = -9.05;

    /// Of a mean of readings, °C.
    pub fn c(counts: f64) -> f64 {
        25.0 + (counts - Self::COUNTS_AT_25_C) / Self::COUNTS_PER_K
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_of_an_encoder_of_14_bits_is_exact() {
        for code in [0_u32, 1, 4096, 16_383] {
            let index_deg = f64::from(code) * 360.0 / 16_384.0;
            assert_eq!((IndexCode::of_deg(index_deg).0, IndexCode(code << 18).deg()), (code << 18, index_deg));
        }
        assert_eq!((IndexCode::of_deg(-1e-9).0, IndexCode::of_deg(-90.0).0), (0, 0xC000_0000));
    }

    /// 181 counts are 20 K: fewer when it is warmer, 1704 at 45 °C; 2066 at 5 °C.
    #[test]
    fn fewer_counts_are_warmer() {
        for (counts, expected_c) in [(1885.0, 25.0), (1704.0, 45.0), (2066.0, 5.0)] {
            assert!((TriadTemperature::c(counts) - expected_c).abs() < 1e-12);
        }
    }

    #[test]
    fn a_reading_of_20_bits_is_exact() {
        for code in [0, 1, -1, 256_000, -128_000, 524_287, -524_288] {
            let g = f64::from(code) / 256_000.0;
            let reading = TriadCode::of_g([g, 0.0, 1.0]).unwrap();
            assert_eq!((reading.0[0], reading.g()), (code << 12, [g, 0.0, 1.0]));
        }
        assert_eq!([f64::NAN, -2.1, 2.048].map(|g| TriadCode::of_g([g, 0.0, 1.0])), [None; 3]);
    }
}

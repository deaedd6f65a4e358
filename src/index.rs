//! The index: the angle of the gyro about its spindle, and what turns it.

use serde::{Deserialize, Serialize};

use crate::units::{DEG_PER_RAD, sin_cos_deg, wrap_180_deg, wrap_360_deg};

/// Indexing: the motor and the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IndexSettings {
    /// The encoder must show the commanded angle within ± this, degrees.
    pub tolerance_deg: f64,
    /// One sigma of the encoder's error at one position, degrees; enters the azimuth's sigma.
    pub sigma_deg: f64,
    /// Corrective moves before the angle counts as wrong.
    pub retries: u8,
    /// Fastest turning, °/s.
    pub speed_deg_s: f64,
    /// Acceleration, °/s².
    pub acceleration_deg_s2: f64,
}

impl Default for IndexSettings {
    fn default() -> Self {
        Self { tolerance_deg: 0.5, sigma_deg: 0.02, retries: 2, speed_deg_s: 30.0, acceleration_deg_s2: 60.0 }
    }
}

/// What the motor shall do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum MotorCommand {
    /// Turn by this many microsteps, counter-clockwise positive.
    Turn { microsteps: i32 },
    /// Stop where it is.
    Stop,
}

/// Mean direction of the sensitive axis about the spindle over an interval: mean cosine and sine of the index angle,
/// counter-clockwise from above, from the mark. Of length 1 at rest, shorter where the index moved in the interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    pub cos: f64,
    pub sin: f64,
}

impl Direction {
    /// Of an index angle, degrees.
    pub fn of_deg(index_deg: f64) -> Self {
        let (sin, cos) = sin_cos_deg(index_deg);
        Self { cos, sin }
    }

    /// Index angle, degrees in [0°, 360°).
    pub fn deg(&self) -> f64 {
        wrap_360_deg(libm::atan2(self.sin, self.cos) * DEG_PER_RAD)
    }
}

/// Mean index angle over a second.
#[derive(Clone, Debug, Default)]
pub struct IndexMean {
    sum: Direction,
    count: u16,
}

impl IndexMean {
    /// A reading of the encoder, degrees.
    pub fn push(&mut self, index_deg: f64) {
        let Direction { cos, sin } = Direction::of_deg(index_deg);
        self.sum.cos += cos;
        self.sum.sin += sin;
        self.count = self.count.saturating_add(1);
    }

    /// Ends the second: degrees in [0°, 360°), `None` without a reading.
    pub fn finish_deg(&mut self) -> Option<f64> {
        let Self { sum, count } = core::mem::take(self);
        (count > 0).then(|| sum.deg())
    }
}

/// The index angle without jumps at full turns, so that a cable is not wound up.
#[derive(Clone, Copy, Debug, Default)]
pub struct IndexAngle {
    unwrapped_deg: Option<f64>,
}

impl IndexAngle {
    /// Takes an encoder reading in [0°, 360°). The first one counts from −5° on: the gyro was parked near zero.
    pub fn push(&mut self, index_deg: f64) {
        self.unwrapped_deg = Some(match self.unwrapped_deg {
            Some(last_deg) => last_deg + wrap_180_deg(index_deg - last_deg),
            None => wrap_360_deg(index_deg + 5.0) - 5.0,
        });
    }

    /// Degrees, counter-clockwise; `None` before the first reading.
    pub fn deg(&self) -> Option<f64> {
        self.unwrapped_deg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_does_not_jump_at_a_full_turn() {
        let mut angle = IndexAngle::default();
        for (reading, unwrapped) in
            [(359.9, -0.1), (0.2, 0.2), (90.0, 90.0), (200.0, 200.0), (350.0, 350.0), (10.0, 370.0)]
        {
            angle.push(reading);
            assert!((angle.deg().unwrap() - unwrapped).abs() < 1e-9);
        }
    }
}

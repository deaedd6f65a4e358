//! The index: the angle of the gyro about its spindle, and what turns it.

use serde::{Deserialize, Serialize};

use crate::codes::IndexCode;
use crate::units::{DEG_PER_RAD, sin_cos_deg, wrap_360_deg};

/// Microsteps of the motor in one degree of the index.
pub const MICROSTEPS_PER_DEG: u16 = 100;

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
    /// The motor's current stays on at a position. Without it the spindle's own friction holds, and no heat comes from the motor.
    pub hold_current: bool,
}

impl Default for IndexSettings {
    fn default() -> Self {
        Self {
            tolerance_deg: 0.5,
            sigma_deg: 0.02,
            retries: 2,
            speed_deg_s: 30.0,
            acceleration_deg_s2: 60.0,
            hold_current: false,
        }
    }
}

/// What the motor shall do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum MotorCommand {
    /// Turn by this many microsteps, counter-clockwise positive.
    Turn { microsteps: i32 },
    /// Stop where it is, and take the current off.
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

    /// Turned counter-clockwise by an angle, degrees.
    pub fn turned_deg(self, angle_deg: f64) -> Self {
        if angle_deg == 0.0 {
            return self;
        }
        let (sin, cos) = sin_cos_deg(angle_deg);
        Self { cos: self.cos * cos - self.sin * sin, sin: self.sin * cos + self.cos * sin }
    }

    /// Index angle, degrees in [0°, 360°).
    pub fn deg(&self) -> f64 {
        wrap_360_deg(libm::atan2(self.sin, self.cos) * DEG_PER_RAD)
    }
}

/// Mean index angle over a second, in which the index turns by less than half a turn.
#[derive(Clone, Debug, Default)]
pub struct IndexMean {
    first: IndexCode,
    /// Sum of the ways from the first reading, counts.
    ways: i64,
    count: u16,
}

impl IndexMean {
    /// A reading of the encoder.
    pub fn push(&mut self, index: IndexCode) {
        if self.count == 0 {
            self.first = index;
        }
        self.ways += index.way_from(self.first);
        self.count = self.count.saturating_add(1);
    }

    /// Ends the second: degrees in [0°, 360°), `None` without a reading.
    pub fn finish_deg(&mut self) -> Option<f64> {
        let Self { first, ways, count } = core::mem::take(self);
        let mean_way_deg = ways as f64 / f64::from(count) * IndexCode::DEG_PER_COUNT;
        (count > 0).then(|| wrap_360_deg(first.deg() + mean_way_deg))
    }
}

/// The index angle without jumps at full turns, so that a cable is not wound up.
#[derive(Clone, Copy, Debug, Default)]
pub struct IndexAngle {
    last: IndexCode,
    /// Counts.
    unwrapped: Option<i64>,
}

impl IndexAngle {
    /// Takes an encoder reading. The first one counts from −5° on: the gyro was parked near zero.
    pub fn push(&mut self, index: IndexCode) {
        /// 5°.
        const PARKED: u32 = u32::MAX / 72;
        self.unwrapped = Some(match self.unwrapped {
            Some(unwrapped) => unwrapped + index.way_from(self.last),
            None => i64::from(index.0.wrapping_add(PARKED)) - i64::from(PARKED),
        });
        self.last = index;
    }

    /// Degrees, counter-clockwise; `None` before the first reading.
    pub fn deg(&self) -> Option<f64> {
        self.unwrapped.map(|unwrapped| unwrapped as f64 * IndexCode::DEG_PER_COUNT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_taken_across_zero() {
        let mut mean = IndexMean::default();
        assert_eq!(mean.finish_deg(), None);
        // A sixteenth of a turn below zero, at zero, and three sixteenths above: a mean of 15 degrees.
        [0xF000_0000, 0, 0x3000_0000].iter().for_each(|&code| mean.push(IndexCode(code)));
        assert!((mean.finish_deg().unwrap() - 15.0).abs() < 1e-9);
        [0xF000_0000, 0xE000_0000, 0x0800_0000].iter().for_each(|&code| mean.push(IndexCode(code)));
        // −22.5°, −45°, 11.25°.
        assert!((mean.finish_deg().unwrap() - 341.25).abs() < 1e-9);
    }

    #[test]
    fn the_angle_does_not_jump_at_a_full_turn() {
        let mut angle = IndexAngle::default();
        for (reading, unwrapped) in
            [(359.9, -0.1), (0.2, 0.2), (90.0, 90.0), (200.0, 200.0), (350.0, 350.0), (10.0, 370.0)]
        {
            angle.push(IndexCode::of_deg(reading));
            assert!((angle.deg().unwrap() - unwrapped).abs() < 1e-7);
        }
    }
}

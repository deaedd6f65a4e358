//! The index: the angle of the gyro about its spindle, and what turns it.

use quantities::codes::IndexCode;
use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use crate::units::{DEG_PER_RAD, sin_cos_deg, wrap_180_deg, wrap_360_deg};

/// The travel of a spindle whose cable is not led over a slip ring begins here, degrees from the mark, where the settings do not say otherwise.
pub const TRAVEL_FROM_DEG: f64 = -5.0;
/// The encoder's noise and the play of the gear are less than this, degrees.
const TRAVEL_SPARE_DEG: f64 = 0.5;
/// Most microsteps a second: fifteen sixteenths of what the motor's slots allow.
const MOST_MICROSTEPS_HZ: f64 = 3000.0;

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
    /// Microsteps of the motor in one turn of the index: steps a turn of the motor, times microsteps a step, times the gear.
    pub microsteps_per_turn: u32,
    /// The cable is led over a slip ring, and the index may turn on and on.
    pub slip_ring: bool,
    /// Where the travel begins without one, degrees from the mark, and how far it goes from there counter-clockwise.
    ///
    /// One turn holds every direction, and the absolute encoder alone tells where in it the spindle is: no count of turns has to survive the power.
    pub travel_from_deg: f64,
    pub travel_deg: f64,
    /// A switch that opens at the ends of the travel is wired to the limit input: where it is open the motor stops, and no fix goes on.
    pub limit_switch: bool,
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
            microsteps_per_turn: 36_000,
            slip_ring: false,
            travel_from_deg: TRAVEL_FROM_DEG,
            travel_deg: 360.0,
            limit_switch: false,
        }
    }
}

impl IndexSettings {
    /// Microsteps in a degree of the index.
    pub fn microsteps_per_deg(&self) -> f64 {
        f64::from(self.microsteps_per_turn) / 360.0
    }

    /// What the fields together must be.
    ///
    /// Errors: a speed that takes more microsteps a second than the motor gets.
    pub fn validate(&self) -> Result<(), Invalid> {
        let fits = self.speed_deg_s * self.microsteps_per_deg() <= MOST_MICROSTEPS_HZ;
        let allowed = "at most 3000 microsteps a second, with index.microsteps_per_turn";
        if fits { Ok(()) } else { Err(Invalid::new("index.speed_deg_s", self.speed_deg_s, allowed)) }
    }

    /// Where to turn from `angle_deg` so that the index points to `wanted_deg`, degrees, both unwrapped.
    ///
    /// Over a slip ring the shorter way. Else within the travel, and so far from its ends that the index never comes to rest where the encoder could read
    /// the other end: what is nearer to them is moved there, by 1° at most with the default tolerance. What lies in the gap of a travel of less than a
    /// turn is moved to the nearer end.
    pub fn target_deg(&self, angle_deg: f64, wanted_deg: f64) -> f64 {
        if self.slip_ring {
            return angle_deg + wrap_180_deg(wanted_deg - angle_deg);
        }
        let Self { travel_from_deg: from_deg, travel_deg, .. } = *self;
        let (turn, end_deg) = (from_deg..from_deg + 360.0, from_deg + travel_deg);
        let within_deg = match turn.contains(&wanted_deg) {
            true => wanted_deg,
            false => from_deg + wrap_360_deg(wanted_deg - from_deg),
        };
        let [first_deg, last_deg] = self.ends_deg();
        let within_deg = if within_deg > 0.5 * (end_deg + turn.end) { from_deg } else { within_deg };
        within_deg.max(first_deg).min(last_deg)
    }

    /// First and last angle within the travel at which the index comes to rest, degrees.
    pub fn ends_deg(&self) -> [f64; 2] {
        let margin_deg = self.tolerance_deg + TRAVEL_SPARE_DEG;
        [self.travel_from_deg + margin_deg, self.travel_from_deg + self.travel_deg - margin_deg]
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
        // No second is so long: without a gyro none ends.
        if self.count == u16::MAX {
            return;
        }
        if self.count == 0 {
            self.first = index;
        }
        self.ways += index.way_from(self.first);
        self.count += 1;
    }

    /// Ends the second: degrees in [0°, 360°), `None` without a reading.
    pub fn finish_deg(&mut self) -> Option<f64> {
        let Self { first, ways, count } = core::mem::take(self);
        let mean_way_deg = ways as f64 / f64::from(count) * IndexCode::DEG_PER_COUNT;
        (count > 0).then(|| wrap_360_deg(first.deg() + mean_way_deg))
    }
}

/// The index angle without jumps at full turns: where in its travel the spindle is.
#[derive(Clone, Copy, Debug)]
pub struct IndexAngle {
    /// Where the travel begins, counts before the mark.
    before_mark: u32,
    last: IndexCode,
    /// Counts.
    unwrapped: Option<i64>,
}

impl Default for IndexAngle {
    fn default() -> Self {
        Self::new(TRAVEL_FROM_DEG)
    }
}

impl IndexAngle {
    /// Before the first reading, of a travel that begins there, −180° to 0°.
    pub fn new(travel_from_deg: f64) -> Self {
        let before_mark = libm::round(-travel_from_deg / IndexCode::DEG_PER_COUNT) as u32;
        Self { before_mark, last: IndexCode::default(), unwrapped: None }
    }

    /// Takes an encoder reading. The first one lies within a turn from where the travel begins.
    pub fn push(&mut self, index: IndexCode) {
        self.unwrapped = Some(match self.unwrapped {
            Some(unwrapped) => unwrapped + index.way_from(self.last),
            None => i64::from(index.0.wrapping_add(self.before_mark)) - i64::from(self.before_mark),
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

    /// 360° is the mark, 358° lies before it; near the ends, 355° and −5°, there is a margin of 1°: a tolerance of 0.5° and 0.5° more.
    #[test]
    fn a_target_lies_within_one_turn_and_not_at_its_ends() {
        let settings = IndexSettings::default();
        for (wanted_deg, target_deg) in [
            (0.0, 0.0),
            (270.0, 270.0),
            (360.0, 0.0),
            (358.0, -2.0),
            (-90.0, 270.0),
            (355.5, -4.0),
            (354.6, 354.0),
            (355.0, -4.0),
            (-5.0, -4.0),
            (720.0 + 33.0, 33.0),
        ] {
            // From wherever.
            for angle_deg in [-4.0, 90.0, 354.0, 700.0] {
                assert!((settings.target_deg(angle_deg, wanted_deg) - target_deg).abs() < 1e-9, "{wanted_deg}");
            }
        }
        // A stop that takes 20°: 335° to 355° go to the nearer end, less the margin.
        let stop = IndexSettings { travel_deg: 340.0, ..settings };
        for (wanted_deg, target_deg) in [(340.0, 334.0), (350.0, -4.0), (334.5, 334.0), (90.0, 90.0)] {
            assert!((stop.target_deg(0.0, wanted_deg) - target_deg).abs() < 1e-9, "{wanted_deg}");
        }
        // A travel that begins half a turn before the mark.
        let centred = IndexSettings { travel_from_deg: -180.0, ..settings };
        for (wanted_deg, target_deg) in [(270.0, -90.0), (180.0, -179.0), (179.5, 179.0), (-30.0, -30.0)] {
            assert!((centred.target_deg(0.0, wanted_deg) - target_deg).abs() < 1e-9, "{wanted_deg}");
        }
        let ring = IndexSettings { slip_ring: true, ..settings };
        for (angle_deg, wanted_deg, target_deg) in [(350.0, 10.0, 370.0), (370.0, 350.0, 350.0), (720.0, 90.0, 810.0)] {
            assert!((ring.target_deg(angle_deg, wanted_deg) - target_deg).abs() < 1e-9, "{wanted_deg}");
        }
    }

    #[test]
    fn a_speed_that_the_motor_cannot_step_is_refused() {
        let settings = IndexSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        // 72000 microsteps in 360° at 15°/s are 3000 a second.
        let fine = IndexSettings { microsteps_per_turn: 72_000, ..settings };
        assert_eq!(fine.validate().unwrap_err().field, "index.speed_deg_s");
        assert_eq!(IndexSettings { speed_deg_s: 15.0, ..fine }.validate(), Ok(()));
    }

    #[test]
    fn the_first_reading_lies_within_the_travel() {
        for (from_deg, reading_deg, first_deg) in [
            (-5.0, 356.0, -4.0),
            (-5.0, 354.0, 354.0),
            (-180.0, 181.0, -179.0),
            (-180.0, 179.0, 179.0),
            (0.0, 359.0, 359.0),
        ] {
            let mut angle = IndexAngle::new(from_deg);
            angle.push(IndexCode::of_deg(reading_deg));
            assert!((angle.deg().unwrap() - first_deg).abs() < 1e-6, "{from_deg} {reading_deg}");
        }
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

//! What the instrument must know before it starts, and how it is kept: [`store`] puts it in flash.
//!
//! Settings are immutable input. Three things are never mixed up: settings that are *missing*, settings that are
//! *corrupt* (the check sum fails) and settings that are readable but make no sense (*invalid*).

pub mod accelerometer;
pub mod store;

use serde::{Deserialize, Serialize};

use accelerometer::AccelerometerCalibration;

use crate::earth::{EARTH_RATE_DEG_H, LatitudeError, earth_rate};
use crate::effects::ErrorModel;
use crate::fix::dwell::MAX_ROWS;
use crate::sequence::MAX_DWELLS;
use crate::sequence::order::Order;

/// Everything that can be set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Geodetic latitude, degrees, north positive, −89 … 89.
    pub latitude_deg: f64,
    pub gyro: GyroSettings,
    pub level: LevelSettings,
    pub disturbance: GateSettings,
    pub jitter: GateSettings,
    pub index: IndexSettings,
    pub sequence: SequenceSettings,
    /// Longest time from the start of a fix to its azimuth, seconds.
    pub time_limit_s: f64,
    /// The calibration; without one every azimuth carries the flag `uncalibrated`.
    pub model: Option<ErrorModel>,
    /// The calibration of the level accelerometers; without one their readings are taken as they are.
    pub accelerometer: Option<AccelerometerCalibration>,
}

/// Which frames the gyro sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, defmt::Format)]
#[serde(rename_all = "kebab-case")]
pub enum GyroFormat {
    /// The project's own 14-byte single-axis frame.
    Compact,
    /// KVH format A, delta angle in radians; the x axis is the one that is used.
    KvhA,
}

/// What is declared about the gyro. The noise figures are what the azimuth's sigma never falls below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroSettings {
    pub format: GyroFormat,
    /// Angle random walk, °/√h.
    pub arw_deg_per_sqrt_h: f64,
    /// Bias instability (the floor of the Allan deviation), °/h.
    pub bias_instability_deg_h: f64,
    /// One sigma of the linear bias drift during a fix, °/h per hour.
    pub drift_deg_h_per_h: f64,
    /// Largest bias that is left after the error model, °/h.
    pub bias_limit_deg_h: f64,
    /// Largest rate that the gyro can read, °/h.
    pub range_deg_h: f64,
    /// Most missing frames that a second of 400 may have and still be repaired; more and it is left out.
    pub repairable_frames: u16,
}

/// The level gate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LevelSettings {
    /// Pitch and roll must both be inside ± this, degrees.
    pub limit_deg: f64,
    /// One sigma of the accelerometers' level error, degrees; enters the azimuth's sigma by tan φ.
    pub sigma_deg: f64,
    /// For this many seconds in a row.
    pub seconds: u16,
    /// Longest wait, seconds.
    pub timeout_s: f64,
}

/// The disturbance gate and the jitter gate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GateSettings {
    /// °/h: for the disturbance gate the excess of |rate| over Ω cos φ, for the jitter gate the change of |rate| from
    /// second to second.
    pub threshold_deg_h: f64,
    /// Seconds in a row that make a verdict.
    pub seconds: u16,
    /// Longest wait, seconds.
    pub timeout_s: f64,
}

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

/// Which positions, in which order, for how long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SequenceSettings {
    pub order: Order,
    /// Measuring time at each position, seconds (for the east-west order: of each of its four long dwells).
    pub dwell_s: u16,
    /// Measuring time at each of the four positions of the east-west order's coarse pass, seconds.
    pub coarse_dwell_s: u16,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            latitude_deg: 0.0,
            gyro: GyroSettings::default(),
            level: LevelSettings::default(),
            disturbance: GateSettings { threshold_deg_h: 2.0, seconds: 3, timeout_s: 120.0 },
            jitter: GateSettings { threshold_deg_h: 3.0, seconds: 5, timeout_s: 90.0 },
            index: IndexSettings::default(),
            sequence: SequenceSettings::default(),
            time_limit_s: 1800.0,
            model: None,
            accelerometer: None,
        }
    }
}

impl Default for GyroSettings {
    fn default() -> Self {
        Self {
            format: GyroFormat::Compact,
            arw_deg_per_sqrt_h: 0.0015,
            bias_instability_deg_h: 0.002,
            drift_deg_h_per_h: 0.1,
            bias_limit_deg_h: 1.0,
            range_deg_h: 500_000.0,
            repairable_frames: 8,
        }
    }
}

impl Default for LevelSettings {
    fn default() -> Self {
        Self { limit_deg: 0.5, sigma_deg: 0.01, seconds: 2, timeout_s: 120.0 }
    }
}

impl Default for IndexSettings {
    fn default() -> Self {
        Self { tolerance_deg: 0.5, sigma_deg: 0.02, retries: 2, speed_deg_s: 30.0, acceleration_deg_s2: 60.0 }
    }
}

impl Default for SequenceSettings {
    fn default() -> Self {
        Self { order: Order::Mirrored, dwell_s: 30, coarse_dwell_s: 10 }
    }
}

/// A field of [`Settings`] whose value is not allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    pub field: &'static str,
    pub value: f64,
    /// What is allowed, for a person.
    pub allowed: &'static str,
}

impl core::fmt::Display for Invalid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} = {}: allowed is {}", self.field, self.value, self.allowed)
    }
}

impl Settings {
    /// Checks every value and what they must be together. A latitude next to a pole is not invalid but refused when a
    /// fix starts, with [`crate::health::Fault::NearPole`].
    pub fn validate(&self) -> Result<(), Invalid> {
        let within = |field, value: f64, low: f64, high: f64, allowed| {
            if (low..=high).contains(&value) { Ok(()) } else { Err(Invalid { field, value, allowed }) }
        };
        if earth_rate(self.latitude_deg) == Err(LatitudeError::NotALatitude) {
            return Err(Invalid { field: "latitude_deg", value: self.latitude_deg, allowed: "-90 to 90" });
        }
        let gyro = &self.gyro;
        within("gyro.arw_deg_per_sqrt_h", gyro.arw_deg_per_sqrt_h, 0.0, 1.0, "0 to 1")?;
        within("gyro.bias_instability_deg_h", gyro.bias_instability_deg_h, 0.0, 10.0, "0 to 10")?;
        within("gyro.drift_deg_h_per_h", gyro.drift_deg_h_per_h, 0.0, 1000.0, "0 to 1000")?;
        within("gyro.bias_limit_deg_h", gyro.bias_limit_deg_h, 0.0, 1000.0, "0 to 1000")?;
        within("gyro.range_deg_h", gyro.range_deg_h, 100.0, 1e7, "100 to 10000000")?;
        within("gyro.repairable_frames", gyro.repairable_frames.into(), 0.0, 40.0, "0 to 40")?;
        within("level.limit_deg", self.level.limit_deg, 0.001, 10.0, "0.001 to 10")?;
        within("level.sigma_deg", self.level.sigma_deg, 0.0, 10.0, "0 to 10")?;
        within("level.seconds", self.level.seconds.into(), 1.0, 60.0, "1 to 60")?;
        within("level.timeout_s", self.level.timeout_s, 1.0, 36_000.0, "1 to 36000")?;
        within("disturbance.seconds", self.disturbance.seconds.into(), 1.0, 600.0, "1 to 600")?;
        within("disturbance.timeout_s", self.disturbance.timeout_s, 1.0, 36_000.0, "1 to 36000")?;
        within("jitter.seconds", self.jitter.seconds.into(), 1.0, 600.0, "1 to 600")?;
        within("jitter.timeout_s", self.jitter.timeout_s, 1.0, 36_000.0, "1 to 36000")?;
        within("index.tolerance_deg", self.index.tolerance_deg, 0.01, 10.0, "0.01 to 10")?;
        within("index.sigma_deg", self.index.sigma_deg, 0.0, 10.0, "0 to 10")?;
        within("index.retries", self.index.retries.into(), 0.0, 20.0, "0 to 20")?;
        within("index.speed_deg_s", self.index.speed_deg_s, 0.1, 30.0, "0.1 to 30")?;
        within("index.acceleration_deg_s2", self.index.acceleration_deg_s2, 1.0, 1000.0, "1 to 1000")?;
        within("sequence.dwell_s", self.sequence.dwell_s.into(), 2.0, 3600.0, "2 to 3600")?;
        within("sequence.coarse_dwell_s", self.sequence.coarse_dwell_s.into(), 2.0, 3600.0, "2 to 3600")?;
        within("time_limit_s", self.time_limit_s, 10.0, 86_400.0, "10 to 86400")?;
        self.sequence.order.validate()?;
        let stays = self.sequence.order.len() * usize::from(self.sequence.dwell_s).div_ceil(MAX_ROWS);
        within(
            "sequence.dwell_s",
            self.sequence.dwell_s.into(),
            2.0,
            if stays <= MAX_DWELLS { 3600.0 } else { 0.0 },
            "2 to 128 x 64 / number of positions",
        )?;

        // A still gyro must pass the gates: its bias and five sigma of its one-second noise lie below the thresholds.
        let noise_deg_h = 60.0 * gyro.arw_deg_per_sqrt_h;
        within(
            "disturbance.threshold_deg_h",
            self.disturbance.threshold_deg_h,
            gyro.bias_limit_deg_h + 5.0 * noise_deg_h,
            1e6,
            "at least gyro.bias_limit_deg_h + 5 x 60 x gyro.arw_deg_per_sqrt_h",
        )?;
        within(
            "jitter.threshold_deg_h",
            self.jitter.threshold_deg_h,
            5.0 * core::f64::consts::SQRT_2 * noise_deg_h,
            1e6,
            "at least 7.07 x 60 x gyro.arw_deg_per_sqrt_h",
        )?;
        within(
            "gyro.range_deg_h",
            gyro.range_deg_h,
            EARTH_RATE_DEG_H + self.disturbance.threshold_deg_h,
            1e7,
            "above the Earth rate and the disturbance threshold",
        )?;
        self.model.as_ref().map_or(Ok(()), ErrorModel::validate)?;
        self.accelerometer.as_ref().map_or(Ok(()), AccelerometerCalibration::validate)
    }
}

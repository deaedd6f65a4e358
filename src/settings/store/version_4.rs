//! Settings as records of version 4 hold them: without `index.hold_current` and `block`.

use serde::Deserialize;

use crate::calibration::accelerometer::AccelerometerCalibration;
use crate::effects::ErrorModel;
use crate::settings::{GateSettings, GyroSettings, IndexSettings, LevelSettings, SequenceSettings, Settings};

/// The fields in the order of the record.
#[derive(Deserialize)]
pub(super) struct Settings4 {
    latitude_deg: f64,
    gyro: GyroSettings,
    level: LevelSettings,
    disturbance: GateSettings,
    jitter: GateSettings,
    index: IndexSettings4,
    sequence: SequenceSettings,
    time_limit_s: f64,
    model: Option<ErrorModel>,
    accelerometer: Option<AccelerometerCalibration>,
}

#[derive(Deserialize)]
struct IndexSettings4 {
    tolerance_deg: f64,
    sigma_deg: f64,
    retries: u8,
    speed_deg_s: f64,
    acceleration_deg_s2: f64,
}

impl From<Settings4> for Settings {
    fn from(old: Settings4) -> Self {
        let IndexSettings4 { tolerance_deg, sigma_deg, retries, speed_deg_s, acceleration_deg_s2 } = old.index;
        let hold_current = IndexSettings::default().hold_current;
        Self {
            latitude_deg: old.latitude_deg,
            gyro: old.gyro,
            level: old.level,
            disturbance: old.disturbance,
            jitter: old.jitter,
            index: IndexSettings { tolerance_deg, sigma_deg, retries, speed_deg_s, acceleration_deg_s2, hold_current },
            sequence: old.sequence,
            time_limit_s: old.time_limit_s,
            model: old.model,
            accelerometer: old.accelerometer,
            block: None,
        }
    }
}

//! What the instrument must know before it starts, and how it is kept: [`store`] puts it in flash.
//!
//! Settings are immutable input. Three things are never mixed up: settings that are *missing*, settings that are
//! *corrupt* (the check sum fails) and settings that are readable but make no sense (*invalid*).

pub mod access;
pub mod analogue;
pub mod fields;
pub mod pieces;
pub mod store;

use access::PublicKey;
pub use analogue::AnalogueSettings;
pub use calibration::accelerometer::AccelerometerCalibration;
use calibration::ellipsoid::Correction;
use heapless::Vec;
pub use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

pub use crate::fix::heading::settings::BlockSettings;
pub use crate::sensing::frame::GyroFormat;
pub use crate::sensing::gates::GateSettings;
pub use crate::sensing::index::IndexSettings;
pub use crate::sensing::level::LevelSettings;
pub use crate::sensing::sample::GyroSettings;
pub use crate::sequence::order::SequenceSettings;

use crate::earth::earth_rate;
use crate::effects::channel::BLOCK_TEMPERATURE;
use crate::effects::{ChannelName, ErrorModel};
use crate::event::AUXILIARY;
use crate::fix::Declared;
use crate::health::Fault;
use crate::sequence::Rules;

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
    /// The block of three gyros that holds the heading after a fix; without one it is not read.
    pub block: Option<BlockSettings>,
    pub link: LinkSettings,
    pub analogue: AnalogueSettings,
}

/// The host's line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkSettings {
    /// NMEA 0183 sentences go over it each second, between the frames of [`crate::link`].
    pub nmea: bool,
    /// Dangerous requests need a session that the holder of this key's secret half has unlocked; without one anybody may do anything.
    pub key: Option<PublicKey>,
}

impl Default for Settings {
    fn default() -> Self {
        let Rules { level, disturbance, jitter, index, sequence, time_limit_s } = Rules::default();
        Self {
            latitude_deg: 0.0,
            gyro: GyroSettings::default(),
            level,
            disturbance,
            jitter,
            index,
            sequence,
            time_limit_s,
            model: None,
            accelerometer: None,
            block: None,
            link: LinkSettings::default(),
            analogue: AnalogueSettings::default(),
        }
    }
}

impl Settings {
    /// Everything that is wrong: the numbers by [`fields`], the order, the model, the accelerometers. A
    /// latitude next to a pole is not invalid but refused when a fix starts, with [`crate::health::Fault::NearPole`].
    pub fn violations(&self) -> impl Iterator<Item = Invalid> + '_ {
        let parts = [
            self.gyro.validate(),
            self.analogue.validate(),
            self.index.validate(),
            self.sequence.order.validate(),
            self.sequence.order.validate_drive(&self.index),
            self.model.as_ref().map_or(Ok(()), ErrorModel::validate),
            self.accelerometer.as_ref().map_or(Ok(()), AccelerometerCalibration::validate),
        ];
        fields::violations(self).chain(parts.into_iter().filter_map(Result::err))
    }

    /// The first of the [`Self::violations`].
    pub fn validate(&self) -> Result<(), Invalid> {
        self.violations().next().map_or(Ok(()), Err)
    }

    /// The channels that the board measures beyond those of every second.
    pub fn channels(&self) -> Vec<ChannelName, { AUXILIARY + 1 }> {
        let of_block = self.block.and(ChannelName::new(BLOCK_TEMPERATURE));
        let mut channels = Vec::new();
        for name in [of_block].into_iter().chain(self.analogue.names()).flatten() {
            let _ = channels.push(name); // there is room for all
        }
        channels
    }

    /// What the sequence goes by.
    pub fn rules(&self) -> Rules {
        Rules {
            level: self.level,
            disturbance: self.disturbance,
            jitter: self.jitter,
            index: self.index,
            sequence: self.sequence.clone(),
            time_limit_s: self.time_limit_s,
        }
    }

    /// What turns readings of the accelerometers into specific force.
    pub fn triad(&self) -> Correction {
        self.accelerometer.map_or(Correction::UNIT, |calibration| calibration.correction())
    }

    /// What a solution rests on beside the data. Errors: the values make no sense, or there is a pole too near.
    pub fn declared(&self) -> Result<Declared, Fault> {
        self.validate().map_err(|_| Fault::SettingsInvalid)?;
        Ok(Declared {
            earth: earth_rate(self.latitude_deg).map_err(|_| Fault::NearPole)?,
            gyro: self.gyro,
            index_sigma_deg: self.index.sigma_deg,
            level_sigma_deg: self.level.sigma_deg,
            level_drift: self.level.drift(),
            calibrated: self.model.is_some(),
            level_calibrated: self.accelerometer.is_some(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is stored of gyro and accelerometers is calibrated, each by itself.
    #[test]
    fn what_is_not_stored_is_not_calibrated() {
        let calibrated = |model: bool, accelerometer: bool| {
            let model = model.then(ErrorModel::default);
            let accelerometer = accelerometer.then_some(AccelerometerCalibration::UNIT);
            let settings = Settings { latitude_deg: 47.0, model, accelerometer, ..Settings::default() };
            let declared = settings.declared().unwrap();
            [declared.calibrated, declared.level_calibrated]
        };
        for stored in [[false, false], [true, false], [false, true]] {
            assert_eq!(calibrated(stored[0], stored[1]), stored);
        }
    }
}

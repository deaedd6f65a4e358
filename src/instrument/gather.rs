//! What the instrument's sensors give, gathered to seconds: live, and from a recording of the same readings.
//!
//! Per reading or frame only sums of whole numbers are made; everything else waits for the end of the second, [`Gatherer::finish`].

use calibration::ellipsoid::Correction;
use quantities::codes::{IndexCode, TriadCode, TriadTemperature};

use crate::effects::Conditions;
use crate::event::Auxiliary;
use crate::fix::accumulator::Second;
use crate::health::Counters;
use crate::sensing::frame::Frame;
use crate::sensing::index::{Direction, IndexMean};
use crate::sensing::level::{LevelSecond, LevelSensor, LevelThermometer};
use crate::sensing::sample::{GyroSettings, RateSecond, Sampler};

/// A second, and what belongs to it.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// Without its index: see [`Self::directed`].
    pub second: Second,
    /// Mean measured index angle, degrees.
    pub index_deg: Option<f64>,
    /// Mean temperature of the inertial block, °C, if it was read.
    pub block_temp_c: Option<f64>,
    /// The analogue channels.
    pub auxiliary: Auxiliary,
}

impl Gathered {
    /// The second with the direction of its index angle.
    pub fn directed(&self) -> Second {
        let index = self.index_deg.map(Direction::of_deg);
        Second { conditions: Conditions { index, ..self.second.conditions }, ..self.second }
    }
}

/// Gathers frames, readings of the accelerometers and of the encoder.
#[derive(Clone, Debug)]
pub struct Gatherer {
    sampler: Sampler,
    level: LevelSensor,
    level_thermometer: LevelThermometer,
    index: IndexMean,
    /// Sum and number of the inertial block's temperatures in this second, 0.1 °C.
    block_temperature: (i32, u16),
    /// Time of the next second's end, once there was a first.
    next_end_s: Option<f64>,
}

impl Gatherer {
    /// `triad` turns readings of the accelerometers into specific force.
    pub fn new(gyro: GyroSettings, triad: Correction) -> Self {
        Self {
            sampler: Sampler::new(gyro),
            level: LevelSensor::new(triad),
            level_thermometer: LevelThermometer::default(),
            index: IndexMean::default(),
            block_temperature: (0, 0),
            next_end_s: None,
        }
    }

    pub fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    /// What turns readings of the accelerometers into specific force.
    pub fn triad(&self) -> &Correction {
        self.level.triad()
    }

    /// Takes another calibration of the accelerometers into use.
    pub fn set_triad(&mut self, triad: Correction) {
        self.level = LevelSensor::new(triad);
    }

    /// A frame of the gyro; gives the second that it completes.
    pub fn frame(&mut self, frame: &Frame, counters: &mut Counters) -> Option<RateSecond> {
        self.sampler.frame(frame, counters)
    }

    /// A tick of the instrument's clock; gives the second that a frame completes which is given up.
    pub fn tick(&mut self, counters: &mut Counters) -> Option<RateSecond> {
        self.sampler.tick(counters)
    }

    /// A frame that is known to be lost; gives the second that it completes.
    pub fn lost_frame(&mut self, counters: &mut Counters) -> Option<RateSecond> {
        self.sampler.lose_slot(counters)
    }

    /// A reading of the accelerometers.
    pub fn acceleration(&mut self, reading: TriadCode) {
        self.level.push(reading);
    }

    /// A reading of their thermometer.
    pub fn level_temperature(&mut self, reading: TriadTemperature) {
        self.level_thermometer.push(reading);
    }

    /// A reading of the encoder.
    pub fn index(&mut self, index: IndexCode) {
        self.index.push(index);
    }

    /// A temperature of the inertial block, 0.1 °C.
    pub fn block_temperature(&mut self, temperature: i16) {
        let (sum, count) = self.block_temperature;
        self.block_temperature = (sum.saturating_add(temperature.into()), count.saturating_add(1));
    }

    /// Ends the second whose gyro part is `rate`. Its end is `now_s` for the first second; the gyro's seconds follow each other
    /// without a gap, each exactly 400 samples long, whatever the delay of the link.
    pub fn finish(&mut self, rate: &RateSecond, now_s: f64) -> Gathered {
        let (sum, count) = core::mem::take(&mut self.block_temperature);
        let block_temp_c = (count > 0).then(|| 0.1 * f64::from(sum) / f64::from(count));
        let index_deg = self.index.finish_deg();
        let level = match self.level.finish() {
            LevelSecond::Good(level) => Some(level),
            LevelSecond::Failed => None,
        };
        let level_temp_c = self.level_thermometer.finish_c().filter(|_| level.is_some());
        let end_s = self.next_end_s.unwrap_or(now_s);
        self.next_end_s = Some(end_s + 1.0);
        let second = Second {
            conditions: Conditions {
                t_s: end_s - 0.5,
                seconds: 1.0,
                raw_rate_deg_h: rate.fog_arcsec,
                level: level.map(|level| level.mean),
                temp_c: rate.temp_c,
                ..Conditions::default()
            },
            moment_arcsec_s: rate.moment_arcsec_s,
            ripple_arcsec: rate.ripple_arcsec,
            level_moment: level.map(|level| level.first).unwrap_or_default(),
            level_temp_c,
            lost_frames: rate.missing,
        };
        Gathered { second, index_deg, block_temp_c, auxiliary: Auxiliary::default() }
    }
}

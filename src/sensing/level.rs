//! Level accelerometers to pitch, roll and level state.
//!
//! Instrument frame: x forward along the mark, y left, z up. At rest the triad reads specific force, (0, 0, +1) g when
//! level; nose up by p gives ax = sin p; left side up by r gives ay = sin r · cos p.

use calibration::ellipsoid::Correction;
use quantities::codes::{TriadCode, TriadTemperature};
use serde::{Deserialize, Serialize};

use crate::units::{ARCSEC_PER_RAD, DEG_PER_RAD};

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
    /// One sigma of the change of the readings with temperature, mg/K.
    pub drift_mg_per_k: f64,
    /// One sigma of what they wander by in an hour, as a random walk, mg.
    pub wander_mg_per_sqrt_h: f64,
}

/// What the level accelerometers' readings do though the base stands still: one sigma of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelDrift {
    /// Change with temperature, arcsec/K.
    pub arcsec_per_k: f64,
    /// Random walk, arcsec in a second.
    pub arcsec_per_sqrt_s: f64,
}

/// Tilt that reads as a thousandth of gravity.
const ARCSEC_PER_MG: f64 = 1e-3 * ARCSEC_PER_RAD;

impl LevelSettings {
    /// The declared drift, as a tilt.
    pub fn drift(&self) -> LevelDrift {
        LevelDrift {
            arcsec_per_k: self.drift_mg_per_k * ARCSEC_PER_MG,
            arcsec_per_sqrt_s: self.wander_mg_per_sqrt_h * ARCSEC_PER_MG / 60.0,
        }
    }
}

impl Default for LevelSettings {
    fn default() -> Self {
        // Of the ADXL355's data sheet: 0.02 mg/K typically, 0.15 mg/K at most.
        Self {
            limit_deg: 0.5,
            sigma_deg: 0.01,
            seconds: 2,
            timeout_s: 120.0,
            drift_mg_per_k: 0.05,
            wander_mg_per_sqrt_h: 0.01,
        }
    }
}

/// Attitude of the instrument against the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tilt {
    /// Nose up positive, degrees.
    pub pitch_deg: f64,
    /// Left side up positive, degrees.
    pub roll_deg: f64,
}

/// A second's mean of the accelerometers, by unit of the local gravity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Specific {
    /// Forward: the upward component of the x axis.
    pub forward: f64,
    /// Left: the upward component of the y axis.
    pub left: f64,
}

/// The level accelerometers over an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelMoments {
    /// Mean specific force, by unit of the local gravity.
    pub mean: Specific,
    /// First moment ∫ (t − middle) · f dt, s² by unit of the local gravity: when in the interval it was larger.
    pub first: Specific,
}

#[cfg(test)]
impl LevelMoments {
    /// Of a reading that does not change within the interval.
    pub fn constant(forward: f64, left: f64) -> Option<Self> {
        Some(Self { mean: Specific::new(forward, left)?, first: Specific { forward: 0.0, left: 0.0 } })
    }
}

impl Specific {
    /// Of the two level components alone, in g; outside ± 0.5 there is no small tilt to speak of: `None`.
    pub fn new(forward_g: f64, left_g: f64) -> Option<Self> {
        let in_range = |g: f64| (-0.5..=0.5).contains(&g);
        (in_range(forward_g) && in_range(left_g)).then_some(Self { forward: forward_g, left: left_g })
    }

    /// Pitch = asin ax, roll = asin(ay / cos pitch), by the arc tangent.
    pub fn tilt(&self) -> Tilt {
        let cos_pitch = libm::sqrt(1.0 - self.forward * self.forward);
        let sin_roll = self.left / cos_pitch;
        let cos_roll = libm::sqrt(1.0 - sin_roll * sin_roll);
        Tilt {
            pitch_deg: libm::atan2(self.forward, cos_pitch) * DEG_PER_RAD,
            roll_deg: libm::atan2(sin_roll, cos_roll) * DEG_PER_RAD,
        }
    }
}

impl Tilt {
    /// Both within ± `limit_deg`.
    pub fn is_level(&self, limit_deg: f64) -> bool {
        self.pitch_deg.abs() <= limit_deg && self.roll_deg.abs() <= limit_deg
    }
}

/// Averages the triad over a second, corrects it and watches that it lives.
#[derive(Clone, Debug)]
pub struct LevelSensor {
    triad: Correction,
    second: Second,
}

/// What came so far.
#[derive(Clone, Debug, Default)]
struct Second {
    /// Sum of the readings, counts.
    sum: [i64; 3],
    /// Sum of the readings times their number in the second, counts.
    numbered: [i64; 3],
    count: u16,
    first: Option<TriadCode>,
    changed: bool,
}

/// Averages the triad's temperature over a second. Of every three readings in a row the middle one counts: one that changed while it was read is
/// far from those beside it.
#[derive(Clone, Debug, Default)]
pub struct LevelThermometer {
    /// The two readings before.
    last: Option<[TriadTemperature; 2]>,
    sum: u32,
    count: u16,
}

impl LevelThermometer {
    pub fn push(&mut self, reading: TriadTemperature) {
        let [before, last] = self.last.unwrap_or([reading; 2]);
        self.last = Some([last, reading]);
        let (low, high) = (before.0.min(last.0), before.0.max(last.0));
        self.sum = self.sum.saturating_add(reading.0.clamp(low, high).into());
        self.count = self.count.saturating_add(1);
    }

    /// Ends the second: its mean, °C; `None`: no reading came.
    pub fn finish_c(&mut self) -> Option<f64> {
        let (sum, count) = (core::mem::take(&mut self.sum), core::mem::take(&mut self.count));
        (count > 0).then(|| TriadTemperature::c(f64::from(sum) / f64::from(count)))
    }
}

/// What a second of the triad was worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelSecond {
    Good(LevelMoments),
    /// No reading came, or the norm is not one g, or not one reading of at least twenty differed from the others.
    Failed,
}

impl LevelSensor {
    /// With what turns readings into specific force in g.
    pub fn new(triad: Correction) -> Self {
        Self { triad, second: Second::default() }
    }

    /// What turns readings into specific force.
    pub fn triad(&self) -> &Correction {
        &self.triad
    }

    /// A reading of the triad.
    pub fn push(&mut self, reading: TriadCode) {
        let second = &mut self.second;
        // No second is so long: without a gyro none ends.
        if second.count == u16::MAX {
            return;
        }
        for ((sum, numbered), code) in second.sum.iter_mut().zip(&mut second.numbered).zip(reading.0) {
            *sum += i64::from(code);
            *numbered += i64::from(second.count) * i64::from(code);
        }
        second.count += 1;
        second.changed |= *second.first.get_or_insert(reading) != reading;
    }

    /// Ends the second.
    pub fn finish(&mut self) -> LevelSecond {
        let Second { sum, numbered, count, changed, .. } = core::mem::take(&mut self.second);
        if count == 0 || (!changed && count >= 20) {
            return LevelSecond::Failed;
        }
        let readings = f64::from(count);
        let mean_g = sum.map(|sum| sum as f64 / (readings * TriadCode::COUNTS_PER_G));
        let [x, y, z] = self.triad.apply(mean_g);
        let norm = libm::sqrt(x * x + y * y + z * z);
        if !(0.9..=1.1).contains(&norm) || z < 0.5 {
            return LevelSecond::Failed;
        }
        // The readings are evenly spaced: number k of n stands for the n-th of the second about (k + 1/2)/n − 1/2. The
        // correction of the triad is linear, so that the moment is corrected as a difference from the mean.
        let mut offset_g = mean_g;
        for ((offset, numbered), sum) in offset_g.iter_mut().zip(numbered).zip(sum) {
            let twice_about_middle = 2 * numbered - i64::from(count - 1) * sum;
            *offset += twice_about_middle as f64 / (2.0 * readings * readings * TriadCode::COUNTS_PER_G);
        }
        let [first_x, first_y, _] = self.triad.apply(offset_g);
        let first = Specific { forward: (first_x - x) / norm, left: (first_y - y) / norm };
        match Specific::new(x / norm, y / norm) {
            Some(mean) => LevelSecond::Good(LevelMoments { mean, first }),
            None => LevelSecond::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two means of a second in which every reading was `g`, give or take a count.
    fn second(g: [f64; 3]) -> LevelSecond {
        let mut sensor = LevelSensor::new(Correction::UNIT);
        let TriadCode([x, y, z]) = TriadCode::of_g(g).unwrap();
        (0..100).for_each(|i| sensor.push(TriadCode([x, y, z + i % 2])));
        sensor.finish()
    }

    fn tilt(g: [f64; 3]) -> Tilt {
        match second(g) {
            LevelSecond::Good(level) => level.mean.tilt(),
            LevelSecond::Failed => panic!("{g:?}"),
        }
    }

    #[test]
    fn nose_up_and_left_side_up_are_positive() {
        // sin 1° = 0.0174524, cos 1° = 0.9998477.
        let nose_up = tilt([0.0174524, 0.0, 0.9998477]);
        assert!((nose_up.pitch_deg - 1.0).abs() < 1e-5 && nose_up.roll_deg.abs() < 1e-9);
        let left_up = tilt([0.0, 0.0174524, 0.9998477]);
        assert!((left_up.roll_deg - 1.0).abs() < 1e-5 && left_up.pitch_deg.abs() < 1e-9);
        // Pitch 30°, roll 20°: ax = 0.5, ay = sin 20° · cos 30° = 0.2961981, az = cos 20° · cos 30° = 0.8137977.
        let both = tilt([0.5, 0.2961981, 0.8137977]);
        assert!((both.pitch_deg - 30.0).abs() < 1e-4 && (both.roll_deg - 20.0).abs() < 1e-4, "{both:?}");
    }

    #[test]
    fn a_calibrated_triad_is_level_where_its_biases_say_otherwise() {
        // Level, x reads its bias of +0.01 g: taken for the nose up by asin 0.01 = 0.573° without the calibration.
        let raw = [0.01, 0.0, 1.0];
        assert!((tilt(raw).pitch_deg - 0.573).abs() < 1e-3);
        let mut sensor = LevelSensor::new(Correction { bias: [0.01, 0.0, 0.0], ..Correction::UNIT });
        sensor.push(TriadCode::of_g(raw).unwrap());
        let LevelSecond::Good(level) = sensor.finish() else { panic!() };
        // Within half a count, 0.5e-9 g.
        assert!(level.mean.forward.abs() < 5e-10 && level.mean.left == 0.0);
    }

    /// The nose rises from −0.01 to +0.01 g through the second: ∫ (t − ½) · 0.02 (t − ½) dt = 0.02/12 s²; a tilt that stays
    /// has no first moment, whatever it is.
    #[test]
    fn the_first_moment_of_a_rising_nose() {
        let mut sensor = LevelSensor::new(Correction { bias: [0.01, 0.0, 0.0], ..Correction::UNIT });
        for i in 0..100 {
            let forward_g = 0.01 + 0.02 * ((f64::from(i) + 0.5) / 100.0 - 0.5);
            sensor.push(TriadCode::of_g([forward_g, 0.005, 1.0]).unwrap());
        }
        let LevelSecond::Good(level) = sensor.finish() else { panic!() };
        // Of a hundred readings instead of the integral: less by a share of 1e-4.
        assert!((level.first.forward - 0.02 / 12.0).abs() < 2e-7, "{}", level.first.forward);
        assert!(level.first.left.abs() < 1e-12 && level.mean.forward.abs() < 1e-10);
    }

    /// 1704 and 1705 codes are 45 °C and 1/9.05 K less. A reading between whose bytes 0x700 became 0x6FF is 0x7FF: it is passed over.
    #[test]
    fn a_temperature_is_a_mean_without_torn_readings() {
        let mut thermometer = LevelThermometer::default();
        assert_eq!(thermometer.finish_c(), None);
        (0..100).for_each(|_| thermometer.push(TriadTemperature(1704)));
        assert_eq!(thermometer.finish_c(), Some(45.0));
        (0..100).for_each(|i| thermometer.push(TriadTemperature(if i < 50 { 1704 } else { 1705 })));
        // The reading before counts in the place of the first one that changed: 51 and 49.
        let mean_c = thermometer.finish_c().unwrap();
        assert!((mean_c - (45.0 - 0.49 / 9.05)).abs() < 1e-12, "{mean_c}");
        let of = |codes: &[u16]| {
            let mut thermometer = LevelThermometer::default();
            codes.iter().for_each(|&code| thermometer.push(TriadTemperature(code)));
            thermometer.finish_c().unwrap()
        };
        assert_eq!(
            of(&[0x700, 0x700, 0x7FF, 0x6FF, 0x6FF]),
            TriadTemperature::c((3 * 0x700 + 2 * 0x700 - 1) as f64 / 5.0)
        );
        assert_eq!(thermometer.finish_c(), None);
    }

    #[test]
    fn the_limit_is_for_each_axis() {
        let tilt = Tilt { pitch_deg: 0.4, roll_deg: -0.6 };
        assert!(tilt.is_level(0.6) && !tilt.is_level(0.5));
    }

    #[test]
    fn a_dead_sensor_is_not_level() {
        assert_eq!(LevelSensor::new(Correction::UNIT).finish(), LevelSecond::Failed);
        assert_eq!(second([0.0, 0.0, 0.0]), LevelSecond::Failed);
        assert_eq!(second([0.0, 0.0, -1.0]), LevelSecond::Failed);
        let mut stuck = LevelSensor::new(Correction::UNIT);
        (0..100).for_each(|_| stuck.push(TriadCode([0, 0, 1 << 30])));
        assert_eq!(stuck.finish(), LevelSecond::Failed);
    }
}

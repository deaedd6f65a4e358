//! The temperature of a dwell.

use super::line::{Apart, Line};

/// 0 °C, kelvin.
const FREEZING_K: f64 = 273.15;

/// The level accelerometers' temperature over a dwell, the gyro's where they have no thermometer, in floats: their rounding is 0.00003 K.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Temperature {
    /// Its mean; 0 where none was measured.
    pub kelvin: f32,
    pub kelvin_per_s: f32,
}

impl Temperature {
    pub(in crate::fix) fn joined(self, next: Self, apart: &Apart) -> Self {
        let line = |Self { kelvin, kelvin_per_s }| Line {
            mean: f64::from(kelvin),
            slope_per_s: f64::from(kelvin_per_s),
            ..Line::default()
        };
        let joined = line(self).joined(&line(next), apart);
        Self { kelvin: joined.mean as f32, kelvin_per_s: joined.slope_per_s as f32 }
    }
}

/// Sums over the seconds of a dwell for the straight line of its temperature; times and temperatures from the first second's.
#[derive(Clone, Copy, Debug, Default)]
pub struct TemperatureSums {
    first_s: f64,
    first_c: f64,
    seconds: u16,
    time: f64,
    time_squares: f64,
    temperature: f64,
    with_time: f64,
}

impl TemperatureSums {
    pub fn push(&mut self, t_s: f64, temp_c: f64) {
        if self.seconds == 0 {
            (self.first_s, self.first_c) = (t_s, temp_c);
        }
        let (time_s, change_k) = (t_s - self.first_s, temp_c - self.first_c);
        self.seconds = self.seconds.saturating_add(1);
        self.time += time_s;
        self.time_squares += time_s * time_s;
        self.temperature += change_k;
        self.with_time += time_s * change_k;
    }

    /// The line at a time.
    pub fn line(&self, t_s: f64) -> Temperature {
        if self.seconds == 0 {
            return Temperature::default();
        }
        let seconds = f64::from(self.seconds);
        let (middle_s, mean_k) = (self.time / seconds, self.temperature / seconds);
        let spread = self.time_squares - self.time * middle_s;
        let kelvin_per_s = if spread > 0.0 { (self.with_time - self.time * mean_k) / spread } else { 0.0 };
        let kelvin = FREEZING_K + self.first_c + mean_k + kelvin_per_s * (t_s - self.first_s - middle_s);
        Temperature { kelvin: kelvin as f32, kelvin_per_s: kelvin_per_s as f32 }
    }
}

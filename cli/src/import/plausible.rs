//! Whether what was read can be the Earth's rate and gravity: wrong units, scales and signs show here first.

use north_finder::earth::EARTH_RATE_DEG_H;

use super::map::Map;
use super::sample::Sample;

/// A triad at rest reads the Earth's rate; its mean may differ by this factor before it is doubted.
const RATE_FACTOR: f64 = 2.0;
/// Share of the Earth's rate by which the vertical mean may miss the latitude's before it is doubted.
const VERTICAL_SHARE: f64 = 0.5;
/// The specific force at rest is 1 g; its mean may differ by this much.
const GRAVITY_G: f64 = 0.1;
/// Level accelerometers alone read nearly nothing.
const LEVEL_G: f64 = 0.5;

/// Means of what was read.
#[derive(Clone, Debug, Default)]
pub struct Means {
    seconds: f64,
    samples: f64,
    arcsec: [f64; 3],
    acceleration_g: [f64; 3],
}

impl Means {
    pub fn push(&mut self, sample: &Sample) {
        self.seconds += sample.interval_s;
        self.samples += 1.0;
        for (sum, value) in self.arcsec.iter_mut().zip(sample.gyro_arcsec) {
            *sum += value;
        }
        for (sum, value) in self.acceleration_g.iter_mut().zip(sample.acceleration_g.unwrap_or_default()) {
            *sum += value;
        }
    }

    /// What is doubtful, in words for a person.
    pub fn doubts(&self, map: &Map) -> Vec<String> {
        if self.samples == 0.0 {
            return Vec::new();
        }
        let mut doubts = Vec::new();
        if map.gyro.axes.is_some() {
            doubts.extend(self.doubt_rate(map.latitude_deg));
        }
        if let Some(accelerometer) = &map.accelerometer {
            doubts.extend(self.doubt_gravity(accelerometer.axes.is_triad()));
        }
        doubts
    }

    fn doubt_rate(&self, latitude_deg: f64) -> Option<String> {
        let mean_deg_h = self.arcsec.map(|sum| sum / self.seconds);
        let norm_deg_h = norm(mean_deg_h);
        let up_deg_h = EARTH_RATE_DEG_H * latitude_deg.to_radians().sin();
        if !(EARTH_RATE_DEG_H / RATE_FACTOR..=EARTH_RATE_DEG_H * RATE_FACTOR).contains(&norm_deg_h) {
            return Some(format!(
                "the triad's mean rate is {norm_deg_h:.3} deg/h, at rest it would be {EARTH_RATE_DEG_H:.3}: the unit or \
                 the scale of [gyro] may be wrong, its biases large, or the base turned"
            ));
        }
        if (mean_deg_h[2] - up_deg_h).abs() > VERTICAL_SHARE * EARTH_RATE_DEG_H {
            return Some(format!(
                "the triad's mean rate about the vertical is {:.3} deg/h, at rest at this latitude it would be \
                 {up_deg_h:.3}: the axes of [gyro], a sign, or latitude_deg may be wrong, or the base turned",
                mean_deg_h[2]
            ));
        }
        None
    }

    fn doubt_gravity(&self, triad: bool) -> Option<String> {
        let [forward, left, up] = self.acceleration_g.map(|sum| sum / self.samples);
        let length = norm([forward, left, up]);
        if !triad {
            return (length > LEVEL_G).then(|| {
                format!("the level accelerometers' mean is {length:.3} g: unit, scale or columns may be wrong")
            });
        }
        if (length - 1.0).abs() > GRAVITY_G {
            return Some(format!(
                "the accelerometers' mean is {length:.4} g, at rest it would be 1: the unit or the scale of \
                 [accelerometer] may be wrong"
            ));
        }
        if up < -1.0 + GRAVITY_G {
            return Some(
                "the accelerometers read -1 g upwards: they measure specific force, +1 g at rest; scale = -1 turns it"
                    .into(),
            );
        }
        (up < 1.0 - GRAVITY_G).then(|| {
            format!("the accelerometers' mean upwards is {up:.4} g, level it would be 1: their axes may be wrong")
        })
    }
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

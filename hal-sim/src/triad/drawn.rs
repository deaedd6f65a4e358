//! Triads as they come, at random.

use super::{AccelerometerTriad, TriadErrors};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A fibre-optic triad before its calibration: biases within ±0.05 °/h, scale factors within ±500 ppm, axes within ±2′ of
/// their places (each uniform).
pub fn gyros(random: &mut ChaCha8Rng) -> TriadErrors {
    TriadErrors {
        bias_deg_h: [(); 3].map(|()| random.random_range(-0.05..0.05)),
        scale_ppm: [(); 3].map(|()| random.random_range(-500.0..500.0)),
        tilt_arcsec: [(); 3].map(|()| [(); 2].map(|()| random.random_range(-120.0..120.0))),
        ..TriadErrors::default()
    }
}

/// The triad of a ship's inertial block before its calibration: errors of [`gyros`], 0.0005 °/√h and a bias instability of
/// 0.001 °/h.
pub fn gyros_of_a_ship(random: &mut ChaCha8Rng) -> TriadErrors {
    TriadErrors { arw_deg_per_sqrt_h: 0.0005, bias_instability_deg_h: 0.001, ..gyros(random) }
}

/// A MEMS triad before its calibration, in g: zeros within ±30 mg, scale factors within ±2 %, axes within ±1° of their
/// places (each uniform); noise of a reading 1 mg.
pub fn accelerometers(random: &mut ChaCha8Rng) -> AccelerometerTriad {
    AccelerometerTriad {
        zero: [(); 3].map(|()| random.random_range(-0.03..0.03)),
        per_g: [(); 3].map(|()| random.random_range(0.98..1.02)),
        tilt_arcsec: [(); 3].map(|()| [(); 2].map(|()| random.random_range(-3600.0..3600.0))),
        noise: 1e-3,
        ..AccelerometerTriad::default()
    }
}

//! Index angles of the axis east and west, the coarse azimuth that leads there, and the least sigma that noise allows.

use super::design::DesignRow;
use super::dwell::DwellSummary;
use crate::earth::EarthRate;
use crate::sensing::index::Direction;
use crate::units::{DEG_PER_RAD, RAD_PER_DEG, wrap_360_deg};

/// Azimuth by dwells in two directions, degrees in [0°, 360°), the gyro's bias taken as none: a bias b makes it wrong by up to
/// √2 b / (Ω cos φ). `None`: the dwells lie in one line.
///
/// Least squares of h cos ψ and h sin ψ alone, by time: enough to turn the axis nearly east.
pub fn coarse_azimuth_deg(dwells: &[DwellSummary], earth: &EarthRate) -> Option<f64> {
    let [mut cc, mut cs, mut ss, mut cr, mut sr, mut s] = [0.0; 6];
    for dwell in dwells {
        let design = DesignRow::new(Direction { cos: dwell.cos, sin: dwell.sin }, dwell.specific(), earth);
        let rate_deg_h = dwell.rate.mean - design.vertical_deg_h;
        cc += dwell.seconds * design.cos * design.cos;
        cs += dwell.seconds * design.cos * design.sin;
        ss += dwell.seconds * design.sin * design.sin;
        cr += dwell.seconds * design.cos * rate_deg_h;
        sr += dwell.seconds * design.sin * rate_deg_h;
        s += dwell.seconds;
    }
    let determinant = cc * ss - cs * cs;
    let regular = determinant > 1e-3 * s * s;
    regular.then(|| wrap_360_deg(libm::atan2(cc * sr - cs * cr, ss * cr - cs * sr) * DEG_PER_RAD))
}

/// Index angle, degrees in [0°, 360°), at which the sensitive axis of an instrument with `azimuth_deg` points east.
pub fn east_index_deg(azimuth_deg: f64) -> f64 {
    wrap_360_deg(azimuth_deg - 90.0)
}

/// The same for west.
pub fn west_index_deg(azimuth_deg: f64) -> f64 {
    wrap_360_deg(azimuth_deg + 90.0)
}

/// Standard deviation in degrees that white noise alone allows: 60√2 · N / (h √T), the bound for any equally spaced
/// positions or a continuous rotation. `arw` in °/√h, `north_deg_h` = Ω cos φ, `seconds` the whole measuring time.
pub fn white_noise_bound_deg(arw_deg_per_sqrt_h: f64, north_deg_h: f64, seconds: f64) -> f64 {
    60.0 * core::f64::consts::SQRT_2 * arw_deg_per_sqrt_h / (north_deg_h * libm::sqrt(seconds)) / RAD_PER_DEG
}

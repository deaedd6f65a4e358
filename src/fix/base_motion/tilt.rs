//! The tilt of the base as the level accelerometers read it in a dwell.

use crate::fix::dwell::{DwellSummary, Line};
use crate::units::ARCSEC_PER_RAD;

/// Both axes of a dwell in arcsec: pitch = forward, roll = left, for the small angles that the level limit allows.
pub fn tilt_arcsec(dwell: &DwellSummary) -> Option<[Line; 2]> {
    Some(dwell.level?.map(|line| Line {
        mean: f64::from(line.mean) * ARCSEC_PER_RAD,
        slope_per_s: f64::from(line.slope_per_s) * ARCSEC_PER_RAD,
        residual_squares: (f64::from(line.residual_squares) * ARCSEC2_PER_RAD2) as f32,
        successive_squares: (f64::from(line.successive_squares) * ARCSEC2_PER_RAD2) as f32,
    }))
}

/// Square arcseconds of a square radian.
const ARCSEC2_PER_RAD2: f64 = ARCSEC_PER_RAD * ARCSEC_PER_RAD;

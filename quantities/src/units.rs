//! Quantities and their units: what is written as a suffix of a name, and the factors between them.
//!
//! Suffixes used everywhere: `_deg`, `_rad`, `_deg_h` (degrees per hour), `_arcsec`, `_s`, `_g` (standard
//! gravity), `_c` (degrees Celsius). One degree per hour held for one second is exactly one arcsecond.

/// Radians in one degree.
pub const RAD_PER_DEG: f64 = core::f64::consts::PI / 180.0;
/// Degrees in one radian.
pub const DEG_PER_RAD: f64 = 180.0 / core::f64::consts::PI;
/// Arcseconds in one radian.
pub const ARCSEC_PER_RAD: f64 = 3600.0 * DEG_PER_RAD;
/// Standard gravity, m/s² (exact by definition, 3rd CGPM 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.80665;

/// An angle in degrees brought into [0°, 360°). Not-a-number stays not-a-number.
pub fn wrap_360_deg(angle_deg: f64) -> f64 {
    let turns = libm::floor(angle_deg / 360.0);
    let wrapped = angle_deg - 360.0 * turns;
    // A tiny negative angle rounds up to exactly 360.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

/// An angle in degrees brought into (−180°, 180°]: the signed way from one direction to another.
pub fn wrap_180_deg(angle_deg: f64) -> f64 {
    let wrapped = wrap_360_deg(angle_deg);
    if wrapped > 180.0 { wrapped - 360.0 } else { wrapped }
}

/// Sine and cosine of an angle in degrees, by `libm` so that host and target agree bit for bit.
pub fn sin_cos_deg(angle_deg: f64) -> (f64, f64) {
    let angle_rad = angle_deg * RAD_PER_DEG;
    (libm::sin(angle_rad), libm::cos(angle_rad))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_keeps_the_stated_intervals() {
        assert_eq!(wrap_360_deg(360.0), 0.0);
        assert_eq!(wrap_360_deg(-90.0), 270.0);
        assert_eq!(wrap_360_deg(725.5), 5.5);
        assert_eq!(wrap_360_deg(-1e-18), 0.0);
        assert_eq!(wrap_180_deg(270.0), -90.0);
        assert_eq!(wrap_180_deg(180.0), 180.0);
        assert_eq!(wrap_180_deg(-180.0), 180.0);
        assert!(wrap_360_deg(f64::NAN).is_nan());
    }
}

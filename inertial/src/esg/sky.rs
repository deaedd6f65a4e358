//! Where a direction among the stars stands over a place on the Earth, and what heading it gives.

use libm::{atan2, cos, hypot, sin};
use nalgebra::{Matrix3, Vector3};
use quantities::earth::EARTH_RATE_DEG_H;
use quantities::units::RAD_PER_DEG;

const EARTH_RATE_RAD_S: f64 = EARTH_RATE_DEG_H * RAD_PER_DEG / 3600.0;
/// The direction must stand this far off the vertical to tell a heading, as a cosine of its elevation: 6°.
const LEAST_LEVEL: f64 = 0.1;

/// Inertial axes to east, north, up at a place and a time (s since the inertial axes were those of the Earth).
pub fn inertial_to_geographic(latitude_rad: f64, longitude_rad: f64, time_s: f64) -> Matrix3<f64> {
    let hour = longitude_rad + EARTH_RATE_RAD_S * time_s;
    let (sin_hour, cos_hour) = (sin(hour), cos(hour));
    let (sin_latitude, cos_latitude) = (sin(latitude_rad), cos(latitude_rad));
    Matrix3::new(
        -sin_hour,
        cos_hour,
        0.0,
        -sin_latitude * cos_hour,
        -sin_latitude * sin_hour,
        cos_latitude,
        cos_latitude * cos_hour,
        cos_latitude * sin_hour,
        sin_latitude,
    )
}

/// The turn of the axes about up, rad, clockwise positive, that brings `expected` over `read` (both east, north, up), and the
/// cosine of the elevation: errors of the direction across it are divided by this. `None` where it is near the vertical.
pub fn turn_to(read: &Vector3<f64>, expected: &Vector3<f64>) -> Option<(f64, f64)> {
    let level = hypot(expected.x, expected.y);
    let cross = expected.x * read.y - expected.y * read.x;
    let along = expected.x * read.x + expected.y * read.y;
    (level > LEAST_LEVEL && hypot(read.x, read.y) > LEAST_LEVEL).then(|| (atan2(cross, along), level))
}

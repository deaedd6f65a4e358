//! The Earth as a turning ellipsoid with a gravitational field.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// WGS 84 (NIMA TR8350.2): half axes, m; gravitational parameter, m³/s²; J2; rate, rad/s.
const EQUATOR_M: f64 = 6_378_137.0;
const POLE_M: f64 = 6_356_752.314_245;
const GRAVITATION_M3_S2: f64 = 3.986_004_418e14;
const J2: f64 = 1.082_629_82e-3;
const J4: f64 = -2.370_91e-6;
/// Rate of the Earth about its axis, rad/s.
pub const RATE_RAD_S: f64 = 7.292_115e-5;

/// Earth's axis.
pub fn axis() -> Vector3<f64> {
    Vector3::z()
}

/// The Earth's turn in `t_s` seconds.
pub fn turn(t_s: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_unchecked(axis()), RATE_RAD_S * t_s)
}

/// Position at geodetic coordinates, m.
pub fn position(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Vector3<f64> {
    let (latitude, longitude) = (latitude_deg.to_radians(), longitude_deg.to_radians());
    let normal = Vector3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin());
    // The point of the ellipsoid with this normal: its support point.
    let squares = Vector3::new(EQUATOR_M * EQUATOR_M, EQUATOR_M * EQUATOR_M, POLE_M * POLE_M);
    let along = squares.component_mul(&normal);
    along / along.dot(&normal).sqrt() + normal * height_m
}

/// Upwards: the ellipsoid's normal through a point within some kilometres of it.
pub fn up(position_m: &Vector3<f64>) -> Vector3<f64> {
    let squares = Vector3::new(EQUATOR_M * EQUATOR_M, EQUATOR_M * EQUATOR_M, POLE_M * POLE_M);
    // The normal at the foot of the perpendicular, whose height is that over the normal of the turn before.
    (0..3).fold(position_m.component_div(&squares).normalize(), |normal, _| {
        let surface = squares.component_mul(&normal);
        let support = surface / surface.dot(&normal).sqrt();
        let foot = position_m - normal * (position_m - support).dot(&normal);
        foot.component_div(&squares).normalize()
    })
}

/// East, north, up as the columns of a matrix.
pub fn east_north_up(position_m: &Vector3<f64>) -> Matrix3<f64> {
    let up = up(position_m);
    let east = axis().cross(&up).normalize();
    Matrix3::from_columns(&[east, up.cross(&east), up])
}

/// Latitude and longitude in degrees, height in metres.
pub fn geodetic(position_m: &Vector3<f64>) -> (f64, f64, f64) {
    let normal = up(position_m);
    let squares = Vector3::new(EQUATOR_M * EQUATOR_M, EQUATOR_M * EQUATOR_M, POLE_M * POLE_M);
    let surface = squares.component_mul(&normal);
    let height_m = (position_m - surface / surface.dot(&normal).sqrt()).dot(&normal);
    (normal.z.asin().to_degrees(), position_m.y.atan2(position_m.x).to_degrees(), height_m)
}

/// Gravitation (without the centrifugal part), m/s²: the zonal harmonics to the fourth degree, as a gradient of the potential.
pub fn gravitation(position_m: &Vector3<f64>) -> Vector3<f64> {
    let r2 = position_m.norm_squared();
    let r = r2.sqrt();
    let (s, s2) = (position_m.z / r, position_m.z * position_m.z / r2);
    let ratio2 = EQUATOR_M * EQUATOR_M / r2;
    let point = GRAVITATION_M3_S2 / r2;
    // Along the radius and along the axis, of each harmonic.
    let p2 = 1.5 * J2 * ratio2;
    let p4 = 0.625 * J4 * ratio2 * ratio2;
    let radial = 1.0 + p2 * (1.0 - 5.0 * s2) + p4 * (-3.0 + 42.0 * s2 - 63.0 * s2 * s2);
    let axial = p2 * 2.0 * s + p4 * s * (-12.0 + 28.0 * s2);
    -(position_m / r * radial + axis() * axial) * point
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal gravity of WGS 84 on the ellipsoid: 9.7803253359 m/s² at the equator, 9.8321849378 m/s² at the poles; J6 and
    /// above are worth 1e-8 of it.
    #[test]
    fn gravity_is_the_normal_one() {
        for (latitude, gravity) in [(0.0, 9.7803253359), (90.0, 9.8321849378)] {
            let r = position(latitude, 20.0, 0.0);
            let spin = axis() * RATE_RAD_S;
            let force = -(gravitation(&r) - spin.cross(&spin.cross(&r)));
            assert!((force.dot(&up(&r)) - gravity).abs() < 1e-6, "{latitude}: {}", force.dot(&up(&r)));
        }
        // On the ellipsoid gravity has no horizontal part.
        let r = position(47.0, 20.0, 0.0);
        let spin = axis() * RATE_RAD_S;
        let force = east_north_up(&r).transpose() * (spin.cross(&spin.cross(&r)) - gravitation(&r));
        assert!(force.x.abs() < 1e-9 && force.y.abs() < 1e-6, "{force}");
    }

    #[test]
    fn geodetic_coordinates_come_back() {
        for height in [-500.0, 0.0, 1500.0] {
            let (latitude, longitude, back) = geodetic(&position(-37.25, 141.5, height));
            assert!(
                (latitude + 37.25).abs() < 1e-11 && (longitude - 141.5).abs() < 1e-11 && (back - height).abs() < 1e-6
            );
        }
    }
}

use nalgebra::{Matrix3, Vector2, Vector3};
use quantities::units::RAD_PER_DEG;

use super::reference::{DriftCoefficients, Reference, error_rates};
use super::sky::{inertial_to_geographic, turn_to};

/// h' = ω × h by small steps (Runge and Kutta's midpoint), far finer than the errors that are looked at.
fn integrate(h: Vector3<f64>, drift: &Vector3<f64>, dt: f64) -> Vector3<f64> {
    (0..1000).fold(h, |h, _| {
        let middle = h + 0.5e-3 * dt * drift.cross(&h);
        h + 1e-3 * dt * drift.cross(&middle)
    })
}

/// The corrected equations of docs/attitude-filter.md against two rotors integrated with drifts that differ: derivatives at time zero
/// from a short time, whose own error is of the order drift × time.
#[test]
fn error_equations_are_those_of_a_rotor() {
    for theta_deg in [20.0, 50.0, 85.0] {
        let theta = theta_deg * RAD_PER_DEG;
        let (s, c) = (libm::sin(theta), libm::cos(theta));
        let h = Vector3::new(0.0, c, s);
        let drift = Vector3::new(0.3, -0.2, 0.5);
        let drift_error = Vector3::new(1e-5, -2e-5, 3e-5);
        let error = Vector2::new(2e-5, -1e-5);
        let off = Vector3::new(error.x, error.y, -error.y * c / s);
        let dt = 1e-4;
        let after = integrate(h + off, &(drift + drift_error), dt) - integrate(h, &drift, dt);
        let rate = (after - off) / dt;
        let predicted = error_rates(theta, &drift, &drift_error, &error);
        // 1e-4 of the rates, which are of the order 1e-5.
        assert!((rate.x - predicted.x).abs() < 5e-9, "{theta_deg}: {rate} {predicted}");
        assert!((rate.y - predicted.y).abs() < 5e-9, "{theta_deg}: {rate} {predicted}");
    }
}

/// The form that the filters use, at the equator of the inertial axes too, over a time in which the axes themselves turn: a block
/// whose axes are the inertial ones has these torques.
#[test]
fn the_plane_of_the_errors_has_no_singular_place() {
    for theta_deg in [0.0, 40.0, 89.9] {
        let theta = theta_deg * RAD_PER_DEG;
        let h = Vector3::new(0.0, libm::cos(theta), libm::sin(theta));
        let block = [0.02, -0.01, 0.03];
        let drift = Vector3::from(block);
        let mut reference = Reference::new(&h, DriftCoefficients { block, ..DriftCoefficients::default() });
        let (a, b) = reference.plane();
        assert!(a.cross(&b).dot(&h) < -0.999_999, "b = a × h");
        let (error, drift_error) = (Vector2::new(2e-5, -1e-5), Vector3::new(1e-5, -2e-5, 3e-5));
        let rotor = integrate(h + a * error.x + b * error.y, &(drift + drift_error), 1.0);
        for _ in 0..1000 {
            reference.advance(1e-3, &Matrix3::identity(), &Vector3::zeros());
        }
        let off = rotor - reference.direction();
        let (first, rise) = reference.plane();
        let got = Vector2::new(off.dot(&first), off.dot(&rise));
        // Δω* = −Δω·b, Δω1 = Δω·a.
        let predicted = error + Vector2::new(-drift_error.dot(&b), drift_error.dot(&a));
        // The drift turns the axes by 0.04 rad, and the drift's error with respect to them by half of that.
        assert!((got - predicted).norm() < 0.03 * drift_error.norm(), "{theta_deg}: {got} {predicted}");
    }
}

/// By hand: over 60° of latitude the Earth's axis stands 60° above the northern horizon.
#[test]
fn the_pole_stands_over_north() {
    let to_geographic: Matrix3<f64> = inertial_to_geographic(60.0 * RAD_PER_DEG, 0.4, 1234.0);
    let pole = to_geographic * Vector3::z();
    assert!((pole - Vector3::new(0.0, 0.5, 0.866_025_4)).norm() < 1e-7);
    // Greenwich at noon of the inertial axes: over the equator, x is up at longitude 0.
    let up = inertial_to_geographic(0.0, 0.0, 0.0) * Vector3::x();
    assert!((up - Vector3::z()).norm() < 1e-12);
    // A quarter of a sidereal day later, 86164.1 s / 4, it has set in the west.
    let west = inertial_to_geographic(0.0, 0.0, 86164.1 / 4.0) * Vector3::x();
    assert!((west - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-5, "{west}");
}

/// What is read east of where it is expected has a heading that is too small: axes that believe themselves turned less.
#[test]
fn the_correction_of_the_heading_has_its_sign() {
    let expected = Vector3::new(0.0, 1.0, 0.0);
    let read = Vector3::new(0.1_f64.sin(), 0.1_f64.cos(), 0.0);
    let (turn, level) = turn_to(&read, &expected).unwrap();
    // The pole is read 0.1 rad to the right of north: the believed heading is 0.1 rad too large.
    assert!((turn + 0.1).abs() < 1e-12 && level == 1.0);
    assert!(turn_to(&read, &Vector3::z()).is_none());
}

/// Drift about the vertical by 1 g of unbalance: h east moves north for a positive one.
#[test]
fn unbalance_precesses_about_the_vertical() {
    let coefficients = DriftCoefficients { unbalance: 1e-6, ..DriftCoefficients::default() };
    let mut reference = Reference::new(&Vector3::x(), coefficients);
    for _ in 0..100 {
        reference.advance(10.0, &Matrix3::identity(), &Vector3::z());
    }
    assert!((reference.direction() - Vector3::new(1.0, 1e-3, 0.0)).norm() < 1e-6, "{}", reference.direction());
}

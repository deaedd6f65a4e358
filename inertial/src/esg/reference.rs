//! The virtual gyro: a momentum direction that drifts as the model says, and the equations of its errors.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::Quaternion;

/// Coefficients of the drift, rad/s.
///
/// The rotor precesses with ω = C·k + u·f + q·(f·h)·f: k is fixed to the block (torques of the suspension), u is the rotor's
/// unbalance along its axis (it precesses about the specific force f, in g), q its unequal stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftCoefficients {
    /// Block axes.
    pub block: [f64; 3],
    /// For 1 g.
    pub unbalance: f64,
    /// For 1 g².
    pub stiffness: f64,
}

/// Number of coefficients.
pub const COEFFICIENTS: usize = 5;

/// The virtual gyro.
#[derive(Clone, Debug)]
pub struct Reference {
    direction: Vector3<f64>,
    first: Vector3<f64>,
    /// Its drift model.
    pub coefficients: DriftCoefficients,
    /// Drift beyond the model: about axis 1, and Δω* across it, rad/s.
    pub residual_rad_s: Vector2<f64>,
}

impl Reference {
    /// Points along `direction` (inertial axes). Axis 1 is perpendicular to it and to the Earth's axis; where they are one, any.
    pub fn new(direction: &Vector3<f64>, coefficients: DriftCoefficients) -> Self {
        let across = direction.cross(&Vector3::z());
        let first = if across.norm() > 0.01 { across } else { Vector3::x() };
        Self { direction: direction.normalize(), first, coefficients, residual_rad_s: Vector2::zeros() }
    }

    /// Momentum direction, inertial axes.
    pub fn direction(&self) -> Vector3<f64> {
        self.direction
    }

    /// Axis 1 and the direction in which h rises from the equator, b = axis 1 × h: the plane of the errors.
    pub fn plane(&self) -> (Vector3<f64>, Vector3<f64>) {
        let across = self.first - self.direction * self.direction.dot(&self.first);
        let a = across.normalize();
        (a, a.cross(&self.direction))
    }

    /// Modelled drift, rad/s, inertial axes. `block` takes block axes to inertial ones, `force_g` is in block axes.
    pub fn drift(&self, block: &Matrix3<f64>, force_g: &Vector3<f64>) -> Vector3<f64> {
        let (a, b) = self.plane();
        let by_coefficient = self.drift_by_coefficient(block, force_g);
        let DriftCoefficients { block: [x, y, z], unbalance, stiffness } = self.coefficients;
        let modelled = by_coefficient.iter().zip([x, y, z, unbalance, stiffness]).map(|(v, k)| v * k);
        // Of Δω* only the part across h moves it: Δω2 = x7·sin θ, Δω3 = −x7·cos θ, which is −x7 along b.
        modelled.fold(Vector3::zeros(), |sum, part| sum + part) + a * self.residual_rad_s.x - b * self.residual_rad_s.y
    }

    /// What each coefficient adds to the drift, inertial axes.
    pub fn drift_by_coefficient(&self, block: &Matrix3<f64>, force_g: &Vector3<f64>) -> [Vector3<f64>; COEFFICIENTS] {
        let force = block * force_g;
        [
            block.column(0).into_owned(),
            block.column(1).into_owned(),
            block.column(2).into_owned(),
            force,
            force * force.dot(&self.direction),
        ]
    }

    /// `dt_s` on; the axes of the errors are carried along, so that an error keeps its components in them but for the drift's own
    /// error: δ1' = Δω*, δη' = Δω1.
    pub fn advance(&mut self, dt_s: f64, block: &Matrix3<f64>, force_g: &Vector3<f64>) {
        let turned = Quaternion::from_rotation_vector(&(self.drift(block, force_g) * dt_s));
        self.direction = turned.rotate(&self.direction).normalize();
        self.first = turned.rotate(&self.first);
    }

    /// Corrects the direction by errors in its plane.
    pub fn correct(&mut self, in_plane: &Vector2<f64>) {
        let (a, b) = self.plane();
        self.direction = (self.direction + a * in_plane.x + b * in_plane.y).normalize();
    }
}

/// Rates of the errors δh1 and δh2 in axes `int`, where h = (0, cos θ, sin θ), at the drift ω and its error Δω.
///
/// δh1' = −(ω3 + ω2·cot θ)·δh2 + Δω2·sin θ − Δω3·cos θ, δh2' = ω3·δh1 + ω1·cot θ·δh2 − Δω1·sin θ, with δh3 = −δh2·cot θ: from
/// h' = ω × h and |h| = 1. Not for θ = 0, where δh2 vanishes: the filters have δη, δh2 = −δη·sin θ, for it,
/// in axes that the virtual gyro carries along ([`Reference::advance`]).
pub fn error_rates(
    theta_rad: f64,
    drift: &Vector3<f64>,
    drift_error: &Vector3<f64>,
    error: &Vector2<f64>,
) -> Vector2<f64> {
    let (s, c) = (libm::sin(theta_rad), libm::cos(theta_rad));
    Vector2::new(
        -(drift.z + drift.y * c / s) * error.y + drift_error.y * s - drift_error.z * c,
        drift.z * error.x + drift.x * c / s * error.y - drift_error.x * s,
    )
}

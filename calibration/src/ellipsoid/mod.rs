//! Ellipsoid calibration of an accelerometer triad: no reference for direction or level is needed.
//!
//! A triad at rest reads gravity in whatever direction: perfect readings lie on a sphere, readings with biases, scale factors
//! and non-orthogonal axes on an ellipsoid. Corrected: f = M · (raw − b), M upper triangular, so that z keeps its direction;
//! |f| = G at rest. A mirrored or turned triad reads the same ellipsoid: neither handedness nor the direction of the triad
//! in the instrument can be found this way.

pub mod attitude;
pub mod coverage;
pub mod fit;
mod prior;
mod quadric;
mod refine;
mod refusal;
mod split;

pub use fit::{Calibration, Entry, Role, Weights, fit, fit_from_sphere, fit_with};
pub use prior::Misalignments;
pub use refusal::{LEAST_ATTITUDES, Refusal};
pub use split::split;

use nalgebra::{Matrix3, Vector3};
use quantities::units::DEG_PER_RAD;

/// What turns a reading into specific force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Reading without specific force, in the unit of the readings.
    pub bias: [f64; 3],
    /// M, rows; upper triangular with a positive diagonal. Unit: that of G over that of the readings.
    pub matrix: [[f64; 3]; 3],
}

impl Default for Correction {
    fn default() -> Self {
        Self::UNIT
    }
}

impl Correction {
    /// What leaves readings as they are.
    pub const UNIT: Self = Self { bias: [0.0; 3], matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// The same in the frame of the sensors, in which M is upper triangular: what a turntable knows of how the triad stands in
    /// its box is left out. `None` for a matrix that cannot be undone.
    pub fn of_sensors(&self) -> Option<Self> {
        let matrix = Matrix3::from(self.matrix).transpose();
        let upper = (matrix.transpose() * matrix).cholesky()?.l().transpose();
        Some(Self::new(&Vector3::from(self.bias), &upper))
    }

    /// Specific force of a reading.
    pub fn apply(&self, raw: [f64; 3]) -> [f64; 3] {
        let ([x, y, z], [bx, by, bz]) = (raw, self.bias);
        let (x, y, z) = (x - bx, y - by, z - bz);
        self.matrix.map(|[mx, my, mz]| mx * x + my * y + mz * z)
    }

    /// Norm of the specific force of a reading.
    pub fn norm(&self, raw: [f64; 3]) -> f64 {
        libm::sqrt(self.apply(raw).iter().map(|part| part * part).sum())
    }

    /// Readings per unit of specific force along the sensitive axes of x, y, z.
    pub fn scale_factors(&self) -> [f64; 3] {
        self.sensitive_axes().map(|axis| axis.norm())
    }

    /// Angles between the sensitive axes x and y, x and z, y and z, degrees: 90 if they are orthogonal.
    pub fn angles_deg(&self) -> [f64; 3] {
        let [x, y, z] = self.sensitive_axes();
        [(x, y), (x, z), (y, z)].map(|(a, b)| libm::acos(a.dot(&b) / (a.norm() * b.norm())) * DEG_PER_RAD)
    }

    /// Rows of M⁻¹: what x, y and z read of a specific force.
    fn sensitive_axes(&self) -> [Vector3<f64>; 3] {
        let [[m11, m12, m13], [_, m22, m23], [_, _, m33]] = self.matrix;
        [
            Vector3::new(1.0 / m11, -m12 / (m11 * m22), (m12 * m23 - m13 * m22) / (m11 * m22 * m33)),
            Vector3::new(0.0, 1.0 / m22, -m23 / (m22 * m33)),
            Vector3::new(0.0, 0.0, 1.0 / m33),
        ]
    }

    fn new(centre: &Vector3<f64>, matrix: &Matrix3<f64>) -> Self {
        Self {
            bias: *centre.as_ref(),
            matrix: [
                [matrix.m11, matrix.m12, matrix.m13],
                [matrix.m21, matrix.m22, matrix.m23],
                [matrix.m31, matrix.m32, matrix.m33],
            ],
        }
    }
}

/// Root mean square of |f| − G over readings at rest; `None` of nothing.
pub fn norm_rms(readings: impl Iterator<Item = [f64; 3]>, correction: &Correction, gravity: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for raw in readings {
        let away = correction.norm(raw) - gravity;
        sum += away * away;
        count += 1.0;
    }
    (count > 0.0).then(|| libm::sqrt(sum / count))
}

/// What readings are taken for before a calibration: as they are, if their norm is G give or take a quarter; otherwise one
/// offset and one factor for all three axes, as a converter's data sheet has them, by least squares.
pub fn nominal(readings: impl Iterator<Item = [f64; 3]> + Clone, gravity: f64) -> Correction {
    let count = readings.clone().count().max(1) as f64;
    let mean_norm = readings.clone().map(|raw| Correction::UNIT.norm(raw)).sum::<f64>() / count;
    if (0.8 * gravity..=1.25 * gravity).contains(&mean_norm) {
        return Correction::UNIT;
    }
    let mut offset = readings.clone().flatten().sum::<f64>() / (3.0 * count);
    let norms =
        |offset: f64| readings.clone().map(move |raw| Correction { bias: [offset; 3], ..Correction::UNIT }.norm(raw));
    let factor = |offset: f64| {
        let (sum, squares) = norms(offset).fold((0.0, 0.0), |(sum, squares), norm| (sum + norm, squares + norm * norm));
        gravity * sum / squares
    };
    for _ in 0..NOMINAL_ITERATIONS {
        // Gauss-Newton for the offset; the best factor goes with it.
        let scale = factor(offset);
        let (mut pull, mut weight) = (0.0, 0.0);
        for (raw, norm) in readings.clone().zip(norms(offset)) {
            let slope = -scale * raw.iter().map(|part| part - offset).sum::<f64>() / norm;
            pull -= slope * (scale * norm - gravity);
            weight += slope * slope;
        }
        let step = pull / weight;
        if !step.is_finite() {
            break;
        }
        offset += step;
    }
    let scale = factor(offset);
    Correction { bias: [offset; 3], matrix: [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale]] }
}

/// Steps of the solution for a common offset.
const NOMINAL_ITERATIONS: usize = 20;

#[cfg(test)]
mod tests;

//! Weighted observations and their normal equations.

use nalgebra::{Matrix4, Vector4};

/// Least share of an unknown that the others must not explain: below it the unknown is not determined.
pub(super) const LEAST_SHARE: f64 = 1e-6;

/// One weighted observation: variance is s²/weight with s² the variance of a one-second rate.
pub(super) struct Observation {
    pub weight: f64,
    /// Factors of h cos ψ, h sin ψ, bias, drift (per hour).
    pub row: Vector4<f64>,
    /// Cosine of twice the index angle, for the closure.
    pub cos_2theta: f64,
    pub rate_deg_h: f64,
}

impl Observation {
    /// Adds to the normal matrix and to the right-hand side.
    pub fn add_to(&self, normal: &mut Matrix4<f64>, right: &mut Vector4<f64>) {
        *normal += self.weight * self.row * self.row.transpose();
        *right += self.weight * self.rate_deg_h * self.row;
    }
}

/// Inverse of a normal matrix; `None` where an unknown is not determined.
pub(super) fn regular_inverse(normal: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let cholesky = normal.cholesky()?;
    // The square of a pivot is what of an unknown those before it do not explain.
    let pivots = cholesky.l_dirty().diagonal();
    let regular =
        pivots.iter().zip(normal.diagonal().iter()).all(|(pivot, whole)| pivot * pivot >= LEAST_SHARE * whole);
    (regular && pivots.iter().all(|pivot| pivot.is_finite())).then(|| cholesky.inverse())
}

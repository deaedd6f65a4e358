//! The gyros' white noise, told by how the window bends beyond the parabola.

use nalgebra::Vector3;

use super::moments::{COEFFICIENTS, Fit};
use crate::units::RAD_PER_DEG;

/// Densities that are tried, from the least to the largest, °/√h, in equal ratios.
const LEAST_DEG_SQRT_H: f64 = 1e-5;
const LARGEST_DEG_SQRT_H: f64 = 1.0;
const CANDIDATES: usize = 61;
/// Orthonormal coefficients that carry it.
const FIRST: usize = 3;

/// Log likelihood of the density of the rate's noise.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseOfRate {
    log_likelihood: [f64; CANDIDATES],
}

impl NoiseOfRate {
    /// Exactly this density, °/√h: from a data sheet.
    pub fn declared(deg_per_sqrt_h: f64) -> Self {
        let nearest = |k: usize| libm::fabs(libm::log(candidate_deg_sqrt_h(k) / deg_per_sqrt_h.max(LEAST_DEG_SQRT_H)));
        let best = (0..CANDIDATES).min_by(|a, b| nearest(*a).total_cmp(&nearest(*b))).unwrap_or(0);
        Self { log_likelihood: core::array::from_fn(|k| if k == best { 0.0 } else { f64::NEG_INFINITY }) }
    }

    /// Of one window: coefficients of the third to the sixth order, each with three parts of which up carries no rate. Their
    /// variance is that of what is left plus g² N² times the growth of the order.
    pub(super) fn of(fit: &Fit, beyond: &[Vector3<f64>; COEFFICIENTS], up: &Vector3<f64>, gravity: f64) -> Self {
        let log_likelihood = core::array::from_fn(|candidate| {
            let n2 = density(candidate);
            (FIRST..COEFFICIENTS)
                .map(|k| {
                    let bend = fit.without(k, beyond);
                    let horizontal = bend - up * up.dot(&bend);
                    let variance = (fit.variance + gravity * gravity * n2 * fit.growth(k)).max(f64::MIN_POSITIVE);
                    -0.5 * horizontal.norm_squared() / variance - libm::log(variance)
                })
                .sum()
        });
        Self { log_likelihood }
    }

    /// Of two windows of one recording.
    pub fn with(mut self, other: &Self) -> Self {
        for (a, b) in self.log_likelihood.iter_mut().zip(other.log_likelihood) {
            *a += b;
        }
        self
    }

    /// The mean of a function of the density, (rad/s)²/Hz, over its likelihood; every ratio is as likely beforehand.
    pub(super) fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        let most = self.log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (sum, weights) = self.log_likelihood.iter().enumerate().fold((0.0, 0.0), |(sum, weights), (k, log)| {
            let weight = libm::exp(log - most);
            (sum + weight * of(density(k)), weights + weight)
        });
        sum / weights
    }

    /// Root of the mean density, °/√h.
    pub fn deg_per_sqrt_h(&self) -> f64 {
        libm::sqrt(self.mean(|n2| n2)) * 60.0 / RAD_PER_DEG
    }
}

fn candidate_deg_sqrt_h(k: usize) -> f64 {
    let step = libm::log(LARGEST_DEG_SQRT_H / LEAST_DEG_SQRT_H) / (CANDIDATES - 1) as f64;
    LEAST_DEG_SQRT_H * libm::exp(step * k as f64)
}

/// (rad/s)²/Hz: 1 °/√h is 1/60 °/√s.
fn density(candidate: usize) -> f64 {
    let rad_per_sqrt_s = candidate_deg_sqrt_h(candidate) * RAD_PER_DEG / 60.0;
    rad_per_sqrt_s * rad_per_sqrt_s
}

//! Whole wavelengths in the phase differences: kept as real numbers until they can only be one set of integers.

use nalgebra::{Matrix4, Vector4};

use super::Filter;
use super::measurement::PhaseDifference;
use super::state::{AMBIGUITY, Errors, PHASES};
use crate::ud::{put, unit};

/// A new ambiguity is known to so many wavelengths: much more than a baseline is long.
const UNKNOWN_WAVELENGTHS: f64 = 100.0;
/// A fixed ambiguity is known to this share of a wavelength.
const FIXED_SHARE: f64 = 1e-3;
/// Integers of the least known ambiguity are tried this many standard deviations around.
const SEARCH_SIGMAS: f64 = 4.0;
/// … but no more than this many to each side.
const SEARCH_MOST: f64 = 20.0;
/// The best set must fit: chi-square of four degrees of freedom is above this once in 10⁴.
const FIT_LIMIT: f64 = 23.5;
/// … and be this much better than the next in chi-square: likelihoods of 10⁴ to 1.
const RATIO_LIMIT: f64 = 18.4;

/// What is followed in one place of the phase differences.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    pair: Option<u16>,
    wavelength_m: f64,
    /// The integer is known.
    pub fixed: bool,
}

impl Filter {
    /// Begins anew with pairs that are new or have slipped: the ambiguity that fits the expected phase, and all doubt about it.
    pub(super) fn follow(&mut self, differences: &[Option<PhaseDifference>; PHASES]) {
        for (place, difference) in differences.iter().enumerate() {
            let Some(difference) = difference.as_ref().filter(|difference| difference.is_finite()) else { continue };
            let known = self.lines.get(place).is_some_and(|line| line.pair == Some(difference.pair));
            if known && !difference.slipped {
                continue;
            }
            let expected = self.expected_phase_m(difference);
            let wavelength_m = difference.wavelength_m;
            if let (Some(line), Some(ambiguity)) =
                (self.lines.get_mut(place), self.estimates.ambiguity_m.get_mut(place))
            {
                *ambiguity = difference.phase_m - expected;
                *line = Line { pair: Some(difference.pair), wavelength_m, fixed: false };
            }
            let sigma_m = UNKNOWN_WAVELENGTHS * wavelength_m;
            self.covariance.add_noise(AMBIGUITY + place, sigma_m * sigma_m);
        }
    }

    /// Fixes all ambiguities at once where one set of integers is far more likely than any other.
    ///
    /// Integers of the one with the largest variance are tried, the others follow by rounding, each given those before
    /// (bootstrapping: P. J. G. Teunissen, GPS Solutions 5(2), 2001).
    pub(super) fn resolve(&mut self) {
        let all = self.lines.iter().all(|line| line.pair.is_some());
        if !all || self.lines.iter().all(|line| line.fixed) {
            return;
        }
        let covariance = |i: usize, j: usize| self.covariance.covariance(AMBIGUITY + i, AMBIGUITY + j);
        let mut order = [0, 1, 2, 3];
        order.sort_unstable_by(|a, b| covariance(*b, *b).total_cmp(&covariance(*a, *a)));
        let line = |place: usize| order.get(place).copied().unwrap_or(0);
        let wavelength = |i: usize| self.lines.get(line(i)).map_or(1.0, |line| line.wavelength_m);
        let wavelengths = Vector4::from_fn(|i, _| wavelength(i));
        let float =
            Vector4::from_fn(|i, _| self.estimates.ambiguity_m.get(line(i)).copied().unwrap_or(0.0) / wavelength(i));
        let sorted = Matrix4::from_fn(|i, j| covariance(line(i), line(j)) / (wavelength(i) * wavelength(j)));
        let Some(root) = sorted.cholesky().map(|cholesky| cholesky.l()) else { return };
        let reach = (SEARCH_SIGMAS * root.m11).min(SEARCH_MOST);
        if reach >= SEARCH_MOST {
            return;
        }
        let (mut best, mut next) = ((f64::INFINITY, Vector4::zeros()), f64::INFINITY);
        let first = libm::ceil(float.x - reach - 0.5);
        for step in 0..=(2.0 * reach + 1.0) as u32 {
            let candidate = conditional_rounding(&float, &root, first + f64::from(step));
            if candidate.0 < best.0 {
                next = best.0;
                best = candidate;
            } else {
                next = next.min(candidate.0);
            }
        }
        if best.0 > FIT_LIMIT || next - best.0 < RATIO_LIMIT {
            return;
        }
        // The next best with another rounding of a later one must be out of reach too.
        if root.diagonal().iter().skip(1).any(|sigma| *sigma >= 1.0 / (2.0 * SEARCH_SIGMAS)) {
            return;
        }
        let mut x = Errors::zeros();
        let off_m = (best.1 - float).component_mul(&wavelengths);
        for (i, (off_m, wavelength_m)) in off_m.iter().zip(wavelengths.iter()).enumerate() {
            let sigma_m = FIXED_SHARE * wavelength_m;
            self.covariance.update(&mut x, &unit(AMBIGUITY + line(i)), *off_m, sigma_m * sigma_m);
        }
        self.feed_back(&x);
        self.lines.iter_mut().for_each(|line| line.fixed = true);
    }

    /// Whether all whole wavelengths are known.
    pub fn ambiguities_fixed(&self) -> bool {
        self.lines.iter().all(|line| line.fixed)
    }
}

/// Chi-square and integers when the first is given; wavelengths.
fn conditional_rounding(float: &Vector4<f64>, root: &Matrix4<f64>, first: f64) -> (f64, Vector4<f64>) {
    let mut integers = Vector4::<f64>::zeros();
    let mut normalised = Vector4::<f64>::zeros();
    for (i, (float, row)) in float.iter().zip(root.row_iter()).enumerate() {
        // Those after this one are still 0.
        let mean = float + row.transpose().dot(&normalised);
        let integer = if i == 0 { first } else { libm::round(mean) };
        put(&mut integers, i, integer);
        put(&mut normalised, i, (integer - mean) / root.get((i, i)).copied().unwrap_or(1.0));
    }
    (normalised.norm_squared(), integers)
}

//! Azimuth and log-likelihood of a run's rows by generalised least squares.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::columns::side_by_side;
use super::course::Course;
use super::evidence::half_of;
use super::run::Run;
use super::switching::Way;
use super::tie::{Tie, tie_down};

/// Rounds in which the amplitude is tied about the azimuth that is found with it.
const ROUNDS_OF_AMPLITUDE: usize = 2;
/// An azimuth that may be any.
const NOWHERE: Prediction = Prediction { azimuth_rad: 0.0, sigma_rad: std::f64::consts::PI, amplitude_deg_h: 0.0 };

/// Azimuth of a run with its standard deviation, and the horizontal rate that the run by itself has then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    pub azimuth_rad: f64,
    pub sigma_rad: f64,
    pub amplitude_deg_h: f64,
}

/// An azimuth, and the log-likelihood of the rows that it comes from, the run's own unknowns and all that is uncertain integrated out.
#[derive(Clone, Copy, Debug)]
pub struct Likely {
    pub log_likelihood: f64,
    pub prediction: Prediction,
}

impl Likely {
    /// Given the azimuth and the log-likelihood less what a further factor gives.
    fn times(self, log_factor: f64) -> Self {
        Self { log_likelihood: self.log_likelihood + log_factor, ..self }
    }
}

/// Azimuth and its standard deviation by generalised least squares.
pub fn least_squares(run: &Run, covariance: &DMatrix<f64>) -> Prediction {
    let (half, _) = half_of(covariance);
    let rows =
        half * side_by_side(run.rate.len(), [&run.design, &DMatrix::from_columns(std::slice::from_ref(&run.rate))]);
    azimuth_by(&rows.tr_mul(&rows), run.north_deg_h).prediction
}

/// What effects leave of a run's rate, beside a factor of the covariance of what is uncertain of them, under a kernel of the run's own
/// process with this standard deviation.
pub fn under_kernel(
    run: &Run,
    (kernel, size_deg_h): (usize, f64),
    residual: &DVector<f64>,
    unsure: &DMatrix<f64>,
) -> Likely {
    let whitened = |columns: &DMatrix<f64>| run.whitening.whiten(kernel, size_deg_h, columns);
    let rate = whitened(&DMatrix::from_columns(std::slice::from_ref(residual)));
    let found = beside_unsure(&whitened(&run.design), &rate, &whitened(unsure), run.north_deg_h);
    found.times(-0.5 * run.whitening.log_determinant(kernel, size_deg_h))
}

/// Beside what happens in the run by itself, averaged over what else every part of that may be; over the ways between levels by their
/// probabilities, whose likelihood (`plain`) is that without what is uncertain of the effects.
pub fn along_course(run: &Run, residual: &DVector<f64>, unsure: &DMatrix<f64>, course: &Course, plain: f64) -> Likely {
    let whitened = |columns: &DMatrix<f64>| run.whitening.whiten(0, 0.0, columns);
    let (design, unsure) = (whitened(&run.design), whitened(unsure));
    let beside = |rate: &DMatrix<f64>, factor: &DMatrix<f64>| {
        let all = side_by_side(run.rate.len(), [&unsure, &whitened(factor)]);
        beside_unsure(&design, rate, &all, run.north_deg_h)
    };
    if !course.ways.is_empty() {
        let of_way = |way: &Way| {
            let rate = whitened(&DMatrix::from_columns(&[residual - &way.mean]));
            (way.log_probability.exp(), beside(&rate, &way.factor).prediction)
        };
        let prediction = average(&course.ways.iter().map(of_way).collect::<Vec<_>>());
        return Likely { log_likelihood: plain, prediction };
    }
    let rate = whitened(&DMatrix::from_columns(std::slice::from_ref(residual)));
    let start = unsure.ncols();
    let all = side_by_side(run.rate.len(), [&unsure, &whitened(&course.factor())]);
    let own = Uncertain::new(side_by_side(run.rate.len(), [&design, &rate]), all);
    let first = own.likely(run.north_deg_h).times(-0.5 * run.whitening.log_determinant(0, 0.0));
    let best = first.prediction;
    let mut found = best;
    for (place, others) in course.others() {
        let place = start + place.start..start + place.end;
        let mut each = vec![(1.0, best)];
        each.extend(others.iter().map(|(behind, other)| {
            let products = own.products_with(place.clone(), &whitened(other));
            (behind.exp(), azimuth_by(&products, run.north_deg_h).prediction)
        }));
        let averaged = average(&each);
        let wider = averaged.sigma_rad.powi(2) - best.sigma_rad.powi(2);
        found.azimuth_rad += averaged.azimuth_rad - best.azimuth_rad;
        found.sigma_rad = (found.sigma_rad.powi(2) + wider.max(0.0)).sqrt();
    }
    Likely { prediction: found, ..first.times(course.log_prior) }
}

/// From whitened rows with a covariance of 1 + L Lᵀ.
fn beside_unsure(design: &DMatrix<f64>, rate: &DMatrix<f64>, unsure: &DMatrix<f64>, north_deg_h: f64) -> Likely {
    let rows = side_by_side(design.nrows(), [design, rate]);
    Uncertain::new(rows, unsure.clone()).likely(north_deg_h)
}

/// Whitened rows X of a run's own unknowns with its rate last, whose covariance V = 1 + L Lᵀ has the inverse 1 − L (1 + Lᵀ L)⁻¹ Lᵀ and the
/// determinant of 1 + Lᵀ L.
struct Uncertain {
    rows: DMatrix<f64>,
    columns: DMatrix<f64>,
    /// Inverse of the lower factor of 1 + Lᵀ L, and its product with Lᵀ X.
    half: DMatrix<f64>,
    along: DMatrix<f64>,
    log_determinant: f64,
    /// Xᵀ V⁻¹ X.
    products: DMatrix<f64>,
}

impl Uncertain {
    fn new(rows: DMatrix<f64>, columns: DMatrix<f64>) -> Self {
        let mut inner = columns.transpose() * &columns;
        (0..inner.nrows()).for_each(|i| inner[(i, i)] += 1.0);
        let (half, log_determinant) = half_of(&inner);
        let along = &half * columns.tr_mul(&rows);
        let products = rows.tr_mul(&rows) - along.tr_mul(&along);
        Self { rows, columns, half, along, log_determinant, products }
    }

    fn likely(&self, north_deg_h: f64) -> Likely {
        azimuth_by(&self.products, north_deg_h).times(-0.5 * self.log_determinant)
    }

    /// Xᵀ V⁻¹ X with others in the place of some columns. Those go as weights go from a regression: of the inverse of 1 + Lᵀ L what they
    /// take part in is taken away; the others come as a covariance of their own beside what is left.
    fn products_with(&self, place: Range<usize>, new: &DMatrix<f64>) -> DMatrix<f64> {
        let gone = self.half.columns(place.start, place.len());
        let (half_of_gone, _) = half_of(&gone.tr_mul(&gone));
        let of_new = &self.half * self.columns.tr_mul(new);
        let rows_of_gone = &half_of_gone * gone.tr_mul(&self.along);
        let new_of_gone = &half_of_gone * gone.tr_mul(&of_new);
        let across = new.tr_mul(&self.rows) - of_new.tr_mul(&self.along) + new_of_gone.tr_mul(&rows_of_gone);
        let mut own = new.tr_mul(new) - of_new.tr_mul(&of_new) + new_of_gone.tr_mul(&new_of_gone);
        (0..own.nrows()).for_each(|i| own[(i, i)] += 1.0);
        let explained = half_of(&own).0 * across;
        &self.products + rows_of_gone.tr_mul(&rows_of_gone) - explained.tr_mul(&explained)
    }
}

/// From the products of whitened rows of a run's own unknowns, its rate last.
fn azimuth_by(products: &DMatrix<f64>, north_deg_h: f64) -> Likely {
    let normal = products.fixed_view::<3, 3>(0, 0).into_owned();
    let right = Vector3::new(products[(0, 3)], products[(1, 3)], products[(2, 3)]);
    azimuth(normal, right, products[(3, 3)], north_deg_h)
}

/// From the normal equations of a run's own unknowns with the square of its rate and, for the azimuth, the amplitude that the horizontal
/// rate must have.
fn azimuth(normal: Matrix3<f64>, right: Vector3<f64>, square: f64, north_deg_h: f64) -> Likely {
    let Some(mut inverse) = normal.try_inverse() else {
        return Likely { log_likelihood: -0.5 * square, prediction: NOWHERE };
    };
    let mut found = inverse * right;
    let amplitude_deg_h = found[0].hypot(found[1]);
    let mut log_likelihood = -0.5 * (square - right.dot(&found) + normal.determinant().ln());
    // About the azimuth that is found, which the amplitude may change.
    for _ in 0..ROUNDS_OF_AMPLITUDE {
        let (mut tied, mut of_tied, mut of_square) = (normal, right, square);
        let ties = [Tie::amplitude(found[1].atan2(found[0]), north_deg_h)];
        tie_down(&ties, &mut tied, &mut of_tied, &mut of_square);
        let Some(of_both) = tied.try_inverse() else { break };
        inverse = of_both;
        found = inverse * of_tied;
        log_likelihood = -0.5 * (of_square - of_tied.dot(&found) + tied.determinant().ln());
    }
    let squared = found[0] * found[0] + found[1] * found[1];
    let gradient = Vector3::new(-found[1], found[0], 0.0) / squared;
    let prediction = Prediction {
        azimuth_rad: found[1].atan2(found[0]),
        sigma_rad: gradient.dot(&(inverse * gradient)).max(0.0).sqrt(),
        amplitude_deg_h,
    };
    Likely { log_likelihood, prediction }
}

/// Into (−π, π].
pub fn wrap(angle_rad: f64) -> f64 {
    (angle_rad + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU
}

/// Mean and standard deviation of a mixture.
pub fn average(each: &[(f64, Prediction)]) -> Prediction {
    let Some(first) = each.first() else { return NOWHERE };
    let total: f64 = each.iter().map(|(weight, _)| weight).sum();
    let about = first.1.azimuth_rad;
    let off = |prediction: &Prediction| wrap(prediction.azimuth_rad - about);
    let mean = each.iter().map(|(weight, prediction)| weight * off(prediction)).sum::<f64>() / total;
    let variance = each
        .iter()
        .map(|(weight, prediction)| weight * (prediction.sigma_rad.powi(2) + (off(prediction) - mean).powi(2)))
        .sum::<f64>()
        / total;
    let amplitude_deg_h =
        each.iter().map(|(weight, prediction)| weight * prediction.amplitude_deg_h).sum::<f64>() / total;
    Prediction { azimuth_rad: about + mean, sigma_rad: variance.sqrt(), amplitude_deg_h }
}

/// The mixture of what is possible, given with its log prior probability: weighted by how likely each makes the rows.
pub fn by_likelihood(each: &[(f64, Likely)]) -> Likely {
    let joint = |(log_prior, likely): &(f64, Likely)| log_prior + likely.log_likelihood;
    let most = each.iter().map(joint).fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        let alike: Vec<(f64, Prediction)> = each.iter().map(|each| (1.0, each.1.prediction)).collect();
        return Likely { log_likelihood: f64::NEG_INFINITY, prediction: average(&alike) };
    }
    let weighted: Vec<(f64, Prediction)> =
        each.iter().map(|each| ((joint(each) - most).exp(), each.1.prediction)).collect();
    let sum: f64 = weighted.iter().map(|each| each.0).sum();
    Likely { log_likelihood: most + sum.ln(), prediction: average(&weighted) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(azimuth_rad: f64, log_likelihood: f64) -> Likely {
        Likely { log_likelihood, prediction: Prediction { azimuth_rad, sigma_rad: 0.1, amplitude_deg_h: 10.0 } }
    }

    /// The second is e^ln 3 times as likely: 0.4 · ¾ = 0.3; variance 0.01 + ¼ 0.3² + ¾ 0.1² = 0.04; the sum of likelihoods is 1 + 3, half of
    /// it each by the prior.
    #[test]
    fn what_is_possible_counts_by_its_likelihood() {
        let half = 0.5f64.ln();
        let found = by_likelihood(&[(half, of(0.0, 0.0)), (half, of(0.4, 3f64.ln()))]);
        assert!((found.prediction.azimuth_rad - 0.3).abs() < 1e-12);
        assert!((found.prediction.sigma_rad - 0.2).abs() < 1e-12);
        assert!((found.log_likelihood - 2f64.ln()).abs() < 1e-12);
        assert!(by_likelihood(&[(0.0, of(0.2, f64::NEG_INFINITY))]).prediction.azimuth_rad == 0.2);
    }

    /// Rows at six positions with a covariance of 1 + L Lᵀ, given by L or whitened by the dense factor: the same azimuth and likelihood, that
    /// of the dense covariance less half the logarithm of its determinant.
    #[test]
    fn what_is_uncertain_is_as_in_the_dense_covariance() {
        let design = DMatrix::from_fn(6, 3, |i, j| [(i as f64).cos(), (i as f64).sin(), 1.0][j]);
        let unsure = DMatrix::from_fn(6, 2, |i, j| 0.3 * (1.0 + i as f64 * (1.0 + j as f64)).sin());
        let rate = DMatrix::from_fn(6, 1, |i, _| 12.0 * (i as f64 - 0.7).cos() + 0.3 * (5.0 * i as f64).sin());
        let found = beside_unsure(&design, &rate, &unsure, 12.0);
        let (half, log_determinant) = half_of(&(DMatrix::identity(6, 6) + &unsure * unsure.transpose()));
        let rows = half * side_by_side(6, [&design, &rate]);
        let dense = azimuth_by(&rows.tr_mul(&rows), 12.0);
        assert!((found.prediction.azimuth_rad - dense.prediction.azimuth_rad).abs() < 1e-9);
        assert!((found.prediction.sigma_rad - dense.prediction.sigma_rad).abs() < 1e-9);
        assert!((found.log_likelihood - (dense.log_likelihood - 0.5 * log_determinant)).abs() < 1e-6);
    }

    /// One column of three, whose effect may be a thousand times the noise, gives its place to two that are nearly the same: as with these from the
    /// beginning.
    #[test]
    fn columns_give_their_place_to_others() {
        let column = |of: f64, size: f64| DMatrix::from_fn(9, 1, |i, _| size * (of * (1.0 + i as f64)).sin());
        let rows = DMatrix::from_fn(9, 4, |i, j| (0.3 + i as f64 * (0.7 + j as f64)).cos());
        let [first, second, third] = [column(0.3, 2.0), column(1.1, 1000.0), column(2.3, 0.5)];
        let new = side_by_side(9, [&column(1.12, 1000.0), &column(1.7, 3.0)]);
        let own = Uncertain::new(rows.clone(), side_by_side(9, [&first, &second, &third]));
        let anew = Uncertain::new(rows, side_by_side(9, [&first, &new, &third]));
        assert!((own.products_with(1..2, &new) - anew.products).norm() < 1e-9);
    }
}

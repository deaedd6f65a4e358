//! The linear Gaussian model: posterior of weights with prior variances, and its evidence.

use nalgebra::{DMatrix, DVector};

/// Share of its diagonal that a covariance gets at most.
const MOST_RAISED: f64 = 1.0;

/// Weights of active functions, given all data.
#[derive(Clone, Debug)]
pub struct Posterior {
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Its factor: the covariance is the product of the factor's transpose with the factor.
    pub factor: DMatrix<f64>,
    /// Part of the log evidence that the weights make: −½ ln det(I + √S G √S) + ½ cᵀ Σ c.
    pub gain: f64,
}

/// From the Gram matrix and right side of whitened columns, and the prior variance of every weight.
pub fn posterior(gram: &DMatrix<f64>, right: &DVector<f64>, variances: &[f64]) -> Posterior {
    let n = variances.len();
    if n == 0 {
        return Posterior {
            mean: DVector::zeros(0),
            covariance: DMatrix::zeros(0, 0),
            factor: DMatrix::zeros(0, 0),
            gain: 0.0,
        };
    }
    let roots: Vec<f64> = variances.iter().map(|variance| variance.sqrt()).collect();
    let mut matrix = DMatrix::from_fn(n, n, |i, j| roots[i] * gram[(i, j)] * roots[j]);
    for i in 0..n {
        matrix[(i, i)] += 1.0;
    }
    let (half, log_determinant) = half_of(&matrix);
    let factor = DMatrix::from_fn(n, n, |i, j| half[(i, j)] * roots[j]);
    let covariance = factor.transpose() * &factor;
    let mean = &covariance * right;
    let gain = 0.5 * right.dot(&mean) - 0.5 * log_determinant;
    Posterior { mean, covariance, factor, gain }
}

/// Greatest gain in log evidence of a group with this Gram matrix and right side over prior variances, and the variance.
pub fn best_variance(gram: &DMatrix<f64>, right: &DVector<f64>, variances: &[f64]) -> (f64, f64) {
    let n = gram.nrows();
    let mut factor = vec![0.0; n * n];
    let mut forward = vec![0.0; n];
    let of = |variance: f64, factor: &mut [f64], forward: &mut [f64]| {
        // Cholesky of 1/variance + G, row by row; small, and many of them.
        let mut log_determinant = n as f64 * variance.ln();
        let mut explained = 0.0;
        for i in 0..n {
            for j in 0..=i {
                let (before, row) = factor.split_at(i * n);
                let other = if j == i { &row[..j] } else { &before[j * n..j * n + j] };
                let sum: f64 = row[..j].iter().zip(other).map(|(a, b)| a * b).sum();
                let value = gram[(i, j)] + if i == j { 1.0 / variance } else { 0.0 } - sum;
                factor[i * n + j] = if i == j { value.max(1e-300).sqrt() } else { value / factor[j * n + j] };
            }
            let diagonal = factor[i * n + i];
            log_determinant += 2.0 * diagonal.ln();
            let sum: f64 = (0..i).map(|j| factor[i * n + j] * forward[j]).sum();
            forward[i] = (right[i] - sum) / diagonal;
            explained += forward[i] * forward[i];
        }
        0.5 * (explained - log_determinant)
    };
    variances
        .iter()
        .map(|&variance| (of(variance, &mut factor, &mut forward), variance))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((0.0, 0.0))
}

/// Inverse of the lower Cholesky factor, and the logarithm of the determinant. A covariance that has lost its definiteness to
/// rounding gets a little of its own diagonal; one that has none left tells nothing: zero.
pub fn half_of(covariance: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let n = covariance.nrows();
    let mut share = 0.0;
    loop {
        let mut raised = covariance.clone();
        for i in 0..n {
            raised[(i, i)] *= 1.0 + share;
        }
        if let Some(factor) = raised.cholesky() {
            let lower = factor.l();
            let log_determinant = 2.0 * lower.diagonal().iter().map(|value| value.ln()).sum::<f64>();
            return (lower_inverse(&lower), log_determinant);
        }
        share = if share == 0.0 { 1e-9 } else { share * 10.0 };
        if share > MOST_RAISED {
            return (DMatrix::zeros(n, n), f64::INFINITY);
        }
    }
}

/// Inverse of a lower triangle, column by column by substitution from its diagonal down: a third of the work of a full one.
fn lower_inverse(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let n = lower.nrows();
    let mut inverse = DMatrix::zeros(n, n);
    for (j, column) in inverse.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
        column[j] = 1.0;
        for (k, of_lower) in lower.as_slice().chunks_exact(n.max(1)).enumerate().skip(j) {
            let found = column[k] / of_lower[k];
            column[k] = found;
            column[k + 1..].iter_mut().zip(&of_lower[k + 1..]).for_each(|(rest, each)| *rest -= found * each);
        }
    }
    inverse
}

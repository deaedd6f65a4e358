//! Tail probabilities and small linear algebra.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::gamma::gamma_ur;

/// A pivot of normal equations with a unit diagonal below this: a column is (nearly) a combination of the others.
const LEAST_PIVOT: f64 = 1e-9;

/// Whether a probability is below what the numbers of a computer hold: it is given as smaller than 1e-300, not as nothing.
pub fn is_below_numbers(probability: f64) -> bool {
    probability < 1e-300
}

/// A p value as a statement, with two digits.
pub fn p_value_in_words(p_value: f64) -> String {
    if is_below_numbers(p_value) { "p < 1e-300".into() } else { format!("p = {p_value:.1e}") }
}

/// Probability that a chi-square with `freedom` degrees of freedom exceeds `value`.
pub fn chi_square_tail(value: f64, freedom: f64) -> f64 {
    if value > 0.0 && freedom > 0.0 { gamma_ur(0.5 * freedom, 0.5 * value) } else { 1.0 }
}

/// Root mean square of errors, and its 95 % interval for normal errors. `None` of nothing.
pub fn rms_with_interval(errors: &[f64]) -> Option<(f64, [f64; 2])> {
    let rms = rms(errors);
    Some((rms, rms_interval(rms, errors.len())?))
}

/// 95 % interval of the standard deviation of normal errors whose root mean square with so many degrees of freedom is this: their number times its square
/// over the variance is a chi-square. `None` of none.
pub fn rms_interval(rms: f64, degrees_of_freedom: usize) -> Option<[f64; 2]> {
    let freedom = degrees_of_freedom as f64;
    (degrees_of_freedom > 0)
        .then(|| [0.025, 0.975].map(|tail| rms * (freedom / chi_square_beyond(tail, freedom)).sqrt()))
}

/// What a chi-square with `freedom` degrees of freedom exceeds with this probability, by bisection: the steps of Newton's method, which libraries take, leave
/// the positive numbers at one degree of freedom.
fn chi_square_beyond(tail: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0 * freedom + 100.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if chi_square_tail(middle, freedom) > tail { low = middle } else { high = middle }
    }
    high
}

/// Sum of products.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// a ← a − factor · b.
pub fn subtract(a: &mut [f64], factor: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a -= factor * b;
    }
}

/// Root mean square; 0 of nothing.
pub fn rms(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { (dot(values, values) / values.len() as f64).sqrt() }
}

/// The middle value; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// An orthonormal basis of what `columns` span beyond `basis`, by Gram and Schmidt twice. A column of which less than a
/// millionth is left is dropped.
pub fn orthonormalise(basis: &[Vec<f64>], columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut new: Vec<Vec<f64>> = Vec::new();
    for mut column in columns {
        let before = dot(&column, &column);
        for _ in 0..2 {
            for each in basis.iter().chain(&new) {
                let along = dot(&column, each);
                subtract(&mut column, along, each);
            }
        }
        let after = dot(&column, &column);
        if after > 1e-8 * before && after > 0.0 {
            let scale = after.sqrt().recip();
            column.iter_mut().for_each(|value| *value *= scale);
            new.push(column);
        }
    }
    new
}

/// Least squares: coefficients of `columns` for `y`, and the inverse of the normal matrix. `None` where a column is
/// (nearly) a combination of the others.
pub fn least_squares(columns: &[&[f64]], y: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let scale: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt().recip()).collect();
    if scale.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let scaled = |i: usize, j: usize| scale[i] * scale[j] * dot(columns[i], columns[j]);
    let factor = DMatrix::from_fn(columns.len(), columns.len(), scaled).cholesky()?;
    if factor.l_dirty().diagonal().iter().any(|pivot| pivot * pivot < LEAST_PIVOT) {
        return None;
    }
    let inverse = factor.inverse();
    let covariance: Vec<Vec<f64>> = (0..columns.len())
        .map(|i| (0..columns.len()).map(|j| scale[i] * scale[j] * inverse[(i, j)]).collect())
        .collect();
    let right: Vec<f64> = columns.iter().map(|column| dot(column, y)).collect();
    Some((covariance.iter().map(|row| dot(row, &right)).collect(), covariance))
}

/// What errors are beyond their sigmas: the standard deviation τ of a further error of each, for which Σ e²/(σ² + τ²) is the number of errors (Paule and
/// Mandel, Journal of Research of the National Bureau of Standards 87, 1982, for a known mean); 0 where the sum is less without one. An error of a wide
/// sigma says as much as another one, so that a single such run hides nothing that the others show. `errors`: errors and their variances.
pub fn beyond_sigmas(errors: &[(f64, f64)]) -> f64 {
    let is_more = |tau2: f64| {
        errors.iter().map(|(error, variance)| error * error / (variance + tau2)).sum::<f64>() > errors.len() as f64
    };
    let (mut low, mut high) = (0.0, errors.iter().map(|(error, _)| error * error).sum::<f64>());
    if !is_more(low) {
        return 0.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if is_more(middle) { low = middle } else { high = middle }
    }
    high.sqrt()
}

/// By how much a standard deviation from so many errors must be widened for ± 1.96 of it to hold 95 %: Student's t over 1.96.
pub fn studentised(number: usize) -> f64 {
    StudentsT::new(0.0, 1.0, number as f64).map_or(1.0, |t| t.inverse_cdf(0.975) / 1.959_964)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_tables() {
        // Upper 5 % of chi-square: 3.841 (1), 18.307 (10), 124.342 (100).
        for (value, freedom) in [(3.8415, 1.0), (18.307, 10.0), (124.342, 100.0)] {
            assert!((chi_square_tail(value, freedom) - 0.05).abs() < 1e-5);
        }
        // Far out the tail keeps its digits: normal, 10 sigma, two-sided 1.524e-23.
        assert!((chi_square_tail(100.0, 1.0) / 1.5239706e-23 - 1.0).abs() < 1e-5);
    }

    /// Four errors of 1°: chi-square of 4 degrees of freedom lies between 0.4844 and 11.143 in 95 %, so the standard deviation
    /// between √(4/11.143) = 0.599° and √(4/0.4844) = 2.874°.
    #[test]
    fn the_interval_of_few_errors_is_wide() {
        let (rms, [low, high]) = rms_with_interval(&[1.0, -1.0, 1.0, -1.0]).unwrap();
        assert!(rms == 1.0 && (low - 0.599).abs() < 1e-3 && (high - 2.874).abs() < 1e-3, "{low} {high}");
        assert_eq!(rms_with_interval(&[]), None);
        // One error: its square over the variance is below the square of the normal quantile of 0.5125, 0.03134, and of 0.9875, 2.2414, with 2.5 % each.
        let (_, [low, high]) = rms_with_interval(&[0.1]).unwrap();
        assert!((low - 0.1 / 2.2414).abs() < 1e-5 && (high - 0.1 / 0.03134).abs() < 1e-2, "{low} {high}");
    }

    /// Two errors of 2 with variances of 1: 2 · 4/(1 + 3) = 2. Errors of 1 and 0, the second with a variance of 1e6: 1/τ² = 2. Errors within their
    /// sigmas leave nothing. With a mean of squares in its place the second would leave nothing, either.
    #[test]
    fn errors_beyond_their_sigmas_by_hand() {
        assert!((beyond_sigmas(&[(2.0, 1.0), (-2.0, 1.0)]) - 3f64.sqrt()).abs() < 1e-9);
        assert!((beyond_sigmas(&[(1.0, 0.0), (0.0, 1e6)]) - 0.5f64.sqrt()).abs() < 1e-9);
        assert_eq!(beyond_sigmas(&[(0.5, 1.0), (1.2, 1.0)]), 0.0);
        assert_eq!(beyond_sigmas(&[]), 0.0);
    }

    #[test]
    fn least_squares_by_hand() {
        // A line through 1, 2, 4 at −1, 0, 1: mean 7/3, slope 3/2; covariances 1/3 and 1/2. A column twice is refused.
        let (ones, t) = ([1.0; 3], [-1.0, 0.0, 1.0]);
        let (found, covariance) = least_squares(&[&ones, &t], &[1.0, 2.0, 4.0]).unwrap();
        assert!((found[0] - 7.0 / 3.0).abs() < 1e-12 && (found[1] - 1.5).abs() < 1e-12);
        assert!((covariance[0][0] - 1.0 / 3.0).abs() < 1e-12 && (covariance[1][1] - 0.5).abs() < 1e-12);
        assert!(least_squares(&[&t, &t], &[1.0, 2.0, 4.0]).is_none());
    }
}

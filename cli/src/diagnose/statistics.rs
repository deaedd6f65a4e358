//! Tail probabilities and small linear algebra.

/// ln Γ(x), x > 0 (Lanczos, J. SIAM Numer. Anal. B 1, 1964, p. 86, with the coefficients of g = 7).
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let t = x + 7.5;
    let series = C.iter().enumerate().skip(1).fold(C[0], |sum, (i, c)| sum + c / (x + i as f64));
    0.5 * std::f64::consts::TAU.ln() + (x + 0.5) * t.ln() - t + series.ln()
}

/// Probability that a chi-square with `freedom` degrees of freedom exceeds `value`.
pub fn chi_square_tail(value: f64, freedom: f64) -> f64 {
    if !(value > 0.0) || freedom <= 0.0 {
        return 1.0;
    }
    let (a, x) = (0.5 * freedom, 0.5 * value);
    let factor = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-16 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - factor * sum).clamp(0.0, 1.0);
    }
    // Continued fraction by Lentz' method.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..1000 {
        let n = f64::from(i) * (a - f64::from(i));
        b += 2.0;
        d = 1.0 / (n * d + b);
        c = b + n / c;
        let change = c * d;
        fraction *= change;
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (factor * fraction).clamp(0.0, 1.0)
}

/// Probability that F with `m` and `n` degrees of freedom exceeds `value`.
pub fn f_tail(value: f64, m: f64, n: f64) -> f64 {
    if !(value > 0.0) || m <= 0.0 || n <= 0.0 {
        return 1.0;
    }
    incomplete_beta(n / (n + m * value), 0.5 * n, 0.5 * m)
}

/// The regularised incomplete beta function, by its continued fraction.
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln()).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(x, a, b) / a
    } else {
        1.0 - front * beta_fraction(1.0 - x, b, a) / b
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    let safe = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / safe(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for i in 1..1000 {
        let m = f64::from(i);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / safe(1.0 + even * d);
        c = safe(1.0 + even / c);
        fraction *= c * d;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / safe(1.0 + odd * d);
        c = safe(1.0 + odd / c);
        let change = c * d;
        fraction *= change;
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    fraction
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
    let gram =
        columns.iter().zip(&scale).map(|(a, s)| columns.iter().zip(&scale).map(|(b, t)| s * t * dot(a, b)).collect());
    let inverse = invert(gram.collect())?;
    let right: Vec<f64> = columns.iter().zip(&scale).map(|(column, s)| s * dot(column, y)).collect();
    let coefficients = inverse.iter().zip(&scale).map(|(row, s)| s * dot(row, &right)).collect();
    let covariance =
        inverse.iter().zip(&scale).map(|(row, s)| row.iter().zip(&scale).map(|(value, t)| s * t * value).collect());
    Some((coefficients, covariance.collect()))
}

/// Inverse of a symmetric matrix with a unit diagonal, by Gauss and Jordan; `None` where a pivot is below 1e-9.
fn invert(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    for (i, row) in matrix.iter_mut().enumerate() {
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for i in 0..n {
        let pivot = matrix[i][i];
        if !(pivot > 1e-9) {
            return None;
        }
        matrix[i].iter_mut().for_each(|value| *value /= pivot);
        let row = matrix[i].clone();
        for (_, other) in matrix.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let factor = other[i];
            subtract(other, factor, &row);
        }
    }
    Some(matrix.into_iter().map(|row| row[n..].to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_tables() {
        // Upper 5 % of chi-square: 3.841 (1), 18.307 (10), 124.342 (100); of F(2, 10) 4.103, of F(10, 100) 1.927.
        for (value, freedom) in [(3.8415, 1.0), (18.307, 10.0), (124.342, 100.0)] {
            assert!((chi_square_tail(value, freedom) - 0.05).abs() < 1e-5);
        }
        for (value, m, n) in [(4.1028, 2.0, 10.0), (1.9267, 10.0, 100.0)] {
            assert!((f_tail(value, m, n) - 0.05).abs() < 1e-5, "{}", f_tail(value, m, n));
        }
        // Far out the tail keeps its digits: normal, 10 sigma, two-sided 1.524e-23.
        assert!((chi_square_tail(100.0, 1.0) / 1.5239706e-23 - 1.0).abs() < 1e-5);
    }
}

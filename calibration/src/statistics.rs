//! Robust scatters, and how improbable a sum of squares is.

/// Factor from the median absolute deviation of Gaussian numbers to their standard deviation.
pub const SIGMA_PER_MEDIAN_DEVIATION: f64 = 1.4826;

/// Probability that a chi-square with `freedom` degrees of freedom exceeds `chi_square`; 1 for none.
///
/// Range: up to about 500 degrees of freedom. Source: Abramowitz and Stegun, Handbook of Mathematical Functions,
/// 26.4.4 and 26.4.5.
pub fn chi_square_p(chi_square: f64, freedom: u32) -> f64 {
    if freedom == 0 || chi_square <= 0.0 {
        return 1.0;
    }
    let half = 0.5 * chi_square;
    // Terms e^−h · h^a / Γ(a + 1), a rising by one from 0 or from 1/2 to freedom/2 − 1.
    let odd = freedom % 2 == 1;
    let (mut sum, mut term, mut a) = if odd {
        let first = 2.0 * libm::sqrt(half / core::f64::consts::PI) * libm::exp(-half);
        (libm::erfc(libm::sqrt(half)), first, 0.5)
    } else {
        (0.0, libm::exp(-half), 0.0)
    };
    for _ in 0..freedom / 2 {
        sum += term;
        a += 1.0;
        term *= half / a;
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upper_tails_of_the_tables() {
        // Abramowitz and Stegun, table 26.8: chi-square at Q = 0.05, 0.01 and 0.001.
        for (freedom, quantiles) in
            [(1, [3.84146, 6.63490, 10.828]), (6, [12.5916, 16.8119, 22.458]), (15, [24.9958, 30.5779, 37.697])]
        {
            for (quantile, p) in quantiles.into_iter().zip([0.05, 0.01, 0.001]) {
                let found = chi_square_p(quantile, freedom);
                assert!((found / p - 1.0).abs() < 1e-3, "{freedom} {quantile}: {found}");
            }
        }
        assert_eq!(chi_square_p(0.0, 6), 1.0);
        assert_eq!(chi_square_p(3.0, 0), 1.0);
        assert_eq!(chi_square_p(1e9, 6), 0.0);
    }
}

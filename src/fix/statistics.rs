//! How improbable a sum of squares is.

/// By how many standard deviations a chi-square with `degrees_of_freedom` exceeds what chance gives, by the cube
/// root approximation (Wilson and Hilferty, Proc. Natl. Acad. Sci. 17, 1931, p. 684). Negative where it falls short.
pub fn chi_square_z_score(chi_square: f64, degrees_of_freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees_of_freedom);
    (libm::cbrt(chi_square / degrees_of_freedom) - (1.0 - spread)) / libm::sqrt(spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_tables() {
        // The upper 0.135 % (three sigma) begin at 28.785 with 10 degrees of freedom, at 17.801 with 4; the upper 2.275 %
        // (two sigma) at 20.771 with 10. The approximation is good to a few hundredths there.
        assert!((chi_square_z_score(28.785, 10.0) - 3.0).abs() < 0.05, "{}", chi_square_z_score(28.785, 10.0));
        assert!((chi_square_z_score(17.801, 4.0) - 3.0).abs() < 0.05, "{}", chi_square_z_score(17.801, 4.0));
        assert!((chi_square_z_score(20.771, 10.0) - 2.0).abs() < 0.05, "{}", chi_square_z_score(20.771, 10.0));
        // The median of chi-square with 12 degrees of freedom is 11.34.
        assert!(chi_square_z_score(11.34, 12.0).abs() < 0.01);
    }
}

//! The mean rate of a dwell on a moving base whose accelerometers err in the velocity.
//!
//! Accelerometers that count increments of velocity, and bases that are pushed to and fro, err by a velocity that stays
//! bounded. So the integral of gyro angle less tilt is a parabola in time with that velocity as its noise: twice the
//! curvature is the mean rate. Two things are known of the noise:
//!
//! - A block that does not sit in the axis about which the base rocks is accelerated by ℓ d²φ/dt², φ the turn and ℓ the
//!   distance; over gravity that is a false tilt of κ d²φ/dt², κ = ℓ/g, and in the integral κ dφ/dt: the gyro's own rate.
//!   κ is estimated beside the parabola, held about zero with the spread that a distance of three metres gives it.
//! - A count that is reached slowly leaves a saw-tooth, so errors of neighbouring seconds are alike. How much is not told by
//!   the few rows of one dwell: the fit is made for several correlations, and estimate and variance are averaged over them
//!   by their restricted likelihood (Patterson and Thompson, Biometrika 58, 1971, p. 545).

use heapless::Vec;
use nalgebra::{Matrix4, Vector4};

use super::dwell::Row;

/// Correlations that are tried of errors one second apart, as of an autoregressive process of the first order.
const CORRELATIONS: [f64; 4] = [0.0, 0.5, 0.8, 0.9];
/// Spread of κ, s²: three metres over gravity.
const ARM_S2: f64 = 0.3;
/// Constant, linear and quadratic term, and κ.
const UNKNOWNS: f64 = 4.0;
/// Weight of what is known of κ by which it is nothing.
const NOT_FREE: f64 = 1e30;
/// Fewest rows that give a rate with a variance.
pub const LEAST_ROWS: usize = 8;

/// Mean rate, °/h, and its variance, of a dwell of `length_s` seconds; `None` for fewer than [`LEAST_ROWS`] rows. `integrals_arcsec_s`: of
/// gyro angle less tilt, the mean over each row, arcsec · s.
pub fn mean_rate(rows: &[Row], integrals_arcsec_s: &[f64], start_s: f64, length_s: f64) -> Option<(f64, f64)> {
    if rows.len() < LEAST_ROWS {
        return None;
    }
    let equations = Equations {
        rows,
        integrals_arcsec_s,
        middle_s: start_s + 0.5 * length_s,
        length_s,
        rate_deg_h: rows.iter().map(|row| row.rate_deg_h).sum::<f64>() / rows.len() as f64,
    };
    // What is left sets the weight of what is known of κ: of the plain parabola, then beside κ.
    let mut known = NOT_FREE;
    for _ in 0..2 {
        known = (equations.fit(0.0, known)?.scatter / (ARM_S2 * ARM_S2)).max(f64::MIN_POSITIVE);
    }
    let mut fits: Vec<Fit, { CORRELATIONS.len() }> = Vec::new();
    for correlation in CORRELATIONS {
        let _ = fits.push(equations.fit(correlation, known)?);
    }
    let best = fits.iter().map(|fit| fit.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
    let weight = |fit: &Fit| libm::exp(fit.log_likelihood - best);
    let all: f64 = fits.iter().map(weight).sum();
    let averaged = |of: &dyn Fn(&Fit) -> f64| fits.iter().map(|fit| weight(fit) * of(fit)).sum::<f64>() / all;
    let mean = averaged(&|fit| fit.rate_deg_h);
    let variance = averaged(&|fit| fit.variance + (fit.rate_deg_h - mean) * (fit.rate_deg_h - mean));
    (mean.is_finite() && variance.is_finite()).then_some((mean, variance))
}

struct Equations<'a> {
    rows: &'a [Row],
    integrals_arcsec_s: &'a [f64],
    middle_s: f64,
    length_s: f64,
    /// Mean of the gyro's rate over the rows.
    rate_deg_h: f64,
}

/// A fit for one correlation.
#[derive(Clone, Copy, Debug)]
struct Fit {
    rate_deg_h: f64,
    /// Its variance, with what the scatter's own uncertainty adds (Student's distribution).
    variance: f64,
    /// Variance of a row, (arcsec · s)².
    scatter: f64,
    /// Restricted log-likelihood of the correlation.
    log_likelihood: f64,
}

impl Equations<'_> {
    /// Generalised least squares: rows less what the correlation predicts of them from the last one are independent.
    fn fit(&self, correlation: f64, known: f64) -> Option<Fit> {
        let mut normal = Matrix4::zeros();
        normal.m44 = known;
        let (mut right, mut squares, mut log_variances) = (Vector4::zeros(), 0.0, 0.0);
        let mut last: Option<(Vector4<f64>, f64, f64)> = None;
        // Rows mostly follow each other at the same interval.
        let (mut step_s, mut alike, mut scale, mut log_variance) = (f64::NAN, 0.0, 1.0, 0.0);
        for (row, &value) in self.rows.iter().zip(self.integrals_arcsec_s) {
            let &Row { t_s: row_s, rate_deg_h, .. } = row;
            let u = (row_s - self.middle_s) / self.length_s;
            let of_row = Vector4::new(1.0, u, u * u, rate_deg_h - self.rate_deg_h);
            let (mut new, mut news) = (of_row, value);
            if let Some((before, value_before, before_s)) =
                last.replace((of_row, value, row_s)).filter(|_| correlation > 0.0)
            {
                if step_s != row_s - before_s {
                    step_s = row_s - before_s;
                    alike = libm::exp(step_s * libm::log(correlation));
                    let variance = 1.0 - alike * alike;
                    scale = 1.0 / libm::sqrt(variance);
                    log_variance = libm::log(variance);
                }
                (new, news) = ((of_row - alike * before) * scale, (value - alike * value_before) * scale);
                log_variances += log_variance;
            }
            normal += new * new.transpose();
            right += news * new;
            squares += news * news;
        }
        let factor = normal.cholesky()?;
        let coefficients = factor.solve(&right);
        let degrees_of_freedom = self.rows.len() as f64 - UNKNOWNS;
        let residual = (squares - right.dot(&coefficients)).max(f64::MIN_POSITIVE);
        let scatter = residual / degrees_of_freedom;
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|pivot| 2.0 * libm::log(*pivot)).sum();
        let per_curvature = 2.0 / (self.length_s * self.length_s);
        // The third column of the inverse.
        let of_curvature = factor.solve(&Vector4::z()).z * scatter * degrees_of_freedom / (degrees_of_freedom - 2.0);
        Some(Fit {
            rate_deg_h: per_curvature * coefficients.z,
            variance: per_curvature * per_curvature * of_curvature,
            scatter,
            log_likelihood: -0.5 * (log_variances + log_determinant + degrees_of_freedom * libm::log(scatter)),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::fix::tests::normal;

    /// A dwell of 40 s at 3 °/h. The integral of the angle is 1.5 t²; of a block two metres off the axis of a rocking of
    /// 100 °/h · cos 2t, with κ = 0.2 s², it is 0.2 · 100 cos 2t more.
    fn rows(error_arcsec_s: impl FnMut(f64) -> f64) -> (Vec<Row>, Vec<f64>) {
        let mut error_arcsec_s = error_arcsec_s;
        (0..40)
            .map(|second| {
                let t_s = f64::from(second) + 0.5;
                let rocking = 100.0 * libm::cos(2.0 * t_s);
                (row(t_s, 3.0 + rocking), 1.5 * t_s * t_s + 0.2 * rocking + error_arcsec_s(t_s))
            })
            .unzip()
    }

    fn row(t_s: f64, rate_deg_h: f64) -> Row {
        Row { t_s, seconds: 1.0, cos: 1.0, sin: 0.0, rate_deg_h, moment_arcsec_s: 0.0, level: None }
    }

    /// Of a dwell that begins at 0 and is as long as its rows.
    fn mean_of((rows, integrals_arcsec_s): &(Vec<Row>, Vec<f64>)) -> Option<(f64, f64)> {
        mean_rate(rows, integrals_arcsec_s, 0.0, rows.len() as f64)
    }

    #[test]
    fn the_arm_to_the_axis_of_rocking_is_found() {
        let (rate_deg_h, variance) = mean_of(&rows(|_| 0.0)).unwrap();
        assert!((rate_deg_h - 3.0).abs() < 1e-3 && variance < 1e-6, "{rate_deg_h} {variance}");
    }

    #[test]
    fn a_gyro_that_rests_needs_no_arm() {
        let still = |number: u16| {
            let middles_s = (0..number).map(|second| f64::from(second) + 0.5);
            middles_s.map(|t_s| (row(t_s, 3.0), 1.5 * t_s * t_s)).unzip()
        };
        assert!((mean_of(&still(40)).unwrap().0 - 3.0).abs() < 1e-9);
        assert!(mean_of(&still(7)).is_none());
    }

    /// Errors of a velocity of 5 arcsec · s that are independent, or alike from second to second by 0.8. The mean square of 400
    /// errors in sigmas has a standard deviation of √(2/400) = 0.07; four of them, and a third for what forty rows do not
    /// tell of the correlation. For white noise the variance is 720 · 5²/40⁵ (0.0133 °/h)².
    #[test]
    fn sigma_covers_independent_errors_and_such_as_are_alike() {
        for alike in [0.0, 0.8] {
            let (mut state, mut ratio, mut sum) = (7, 0.0, 0.0);
            for _ in 0..400 {
                let mut last = 5.0 * normal(&mut state);
                let rows = rows(|_| {
                    last = alike * last + 5.0 * libm::sqrt(1.0 - alike * alike) * normal(&mut state);
                    last
                });
                let (rate_deg_h, variance) = mean_of(&rows).unwrap();
                ratio += (rate_deg_h - 3.0) * (rate_deg_h - 3.0) / variance / 400.0;
                sum += (rate_deg_h - 3.0) * (rate_deg_h - 3.0) / 400.0;
            }
            std::println!("{alike}: {ratio:.3}, {:.4} °/h rms", libm::sqrt(sum));
            assert!((0.4..1.6).contains(&ratio), "{alike}: {ratio}");
            if alike == 0.0 {
                assert!(libm::sqrt(sum) < 1.2 * 0.0133, "{}", libm::sqrt(sum));
            }
        }
    }
}

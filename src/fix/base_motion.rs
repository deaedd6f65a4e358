//! Turning of the base during a fix, from the level accelerometers.
//!
//! A base that tilts adds cos θ · dr/dt − sin θ · dp/dt to what the indexed gyro reads: a first harmonic, just like the
//! azimuth itself, so no closure shows it. The accelerometers feel the same tilt. Two ways to use them:
//!
//! - *path*: the tilt over the whole fix as a polynomial in time, of one degree more than the data ask for (at most
//!   the fourth); the rate at each dwell is its mean derivative. Precise, for a base that creeps smoothly.
//! - *slopes*: the tilt's slope inside each dwell. For a base that jumps between dwells, where a path has no meaning.
//!
//! Nothing is corrected unless the motion is significant, because the correction carries the accelerometers' noise.

use nalgebra::{SMatrix, SVector};

use super::dwell::{DwellSummary, Line};
use super::statistics::chi_square_z_score;
use crate::units::ARCSEC_PER_RAD;

const DEGREES: usize = 5;
/// A degree is taken when it lowers the sum of squares of both axes (two degrees of freedom) by this many variances:
/// by chance that happens once in e^(20/2) = 22 000 times.
const SIGNIFICANT: f64 = 20.0;
/// Excess of a chi-square, in standard deviations, that is not put down to chance.
const IMPROBABLE_SIGMAS: f64 = 4.0;

/// Least share of a power of time that those below it must not explain.
const LEAST_SHARE: f64 = 1e-12;

/// What the base did.
#[allow(clippy::large_enum_variant)] // without a heap there is no smaller place
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseMotion {
    /// Too little is measured to say.
    Unknown,
    /// Nothing significant.
    Still,
    Moving(Method),
}

/// How the motion is taken out.
#[allow(clippy::large_enum_variant)] // as above
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    Path(Path),
    /// Variance of a one-second tilt, arcsec², pitch and roll.
    Slopes {
        variance: [f64; 2],
    },
}

/// Polynomials of pitch and roll in time, arcsec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Middle and half the length of the fix, seconds: times lie within ± 1, to keep the normal equations well conditioned.
    middle_s: f64,
    half_s: f64,
    coefficients: [SVector<f64, DEGREES>; 2],
    /// Covariance of the coefficients of each axis.
    covariance: [SMatrix<f64, DEGREES, DEGREES>; 2],
}

/// Powers 0 … 4 of a time.
fn powers(t: f64) -> SVector<f64, DEGREES> {
    SVector::from([1.0, t, t * t, t * t * t, t * t * t * t])
}

impl Path {
    /// Mean derivative of the powers over a dwell, 1/s.
    pub fn rates(&self, dwell: &DwellSummary) -> SVector<f64, DEGREES> {
        let at = |t_s: f64| powers((t_s - self.middle_s) / self.half_s);
        (at(dwell.end_s) - at(dwell.start_s)) / (dwell.end_s - dwell.start_s)
    }

    pub fn coefficients(&self) -> &[SVector<f64, DEGREES>; 2] {
        &self.coefficients
    }

    pub fn covariance(&self) -> &[SMatrix<f64, DEGREES, DEGREES>; 2] {
        &self.covariance
    }
}

/// Square arcseconds of a square radian.
const ARCSEC2_PER_RAD2: f64 = ARCSEC_PER_RAD * ARCSEC_PER_RAD;

/// Both axes of a dwell in arcsec: pitch = forward, roll = left, for the small angles that the level limit allows.
fn tilt_arcsec(dwell: &DwellSummary) -> Option<[Line; 2]> {
    Some(dwell.level?.map(|line| Line {
        mean: f64::from(line.mean) * ARCSEC_PER_RAD,
        slope_per_s: f64::from(line.slope_per_s) * ARCSEC_PER_RAD,
        residual_squares: (f64::from(line.residual_squares) * ARCSEC2_PER_RAD2) as f32,
        successive_squares: (f64::from(line.successive_squares) * ARCSEC2_PER_RAD2) as f32,
    }))
}

/// Tilt rate (pitch, roll) inside one dwell, arcsec/s, that is °/h.
pub fn slopes_deg_h(dwell: &DwellSummary) -> [f64; 2] {
    tilt_arcsec(dwell).map_or([0.0; 2], |axes| axes.map(|line| line.slope_per_s))
}

/// Looks for motion in the dwells of a fix.
pub fn detect(dwells: &[DwellSummary]) -> BaseMotion {
    let degrees_of_freedom: f64 = dwells.iter().map(|dwell| f64::from(dwell.degrees_of_freedom)).sum();
    let (Some(start_s), true) = (dwells.first().map(|dwell| dwell.start_s), degrees_of_freedom >= 10.0) else {
        return BaseMotion::Unknown;
    };
    let mut scatter = [0.0; 2];
    for dwell in dwells {
        let Some(axes) = tilt_arcsec(dwell) else { return BaseMotion::Unknown };
        for (sum, line) in scatter.iter_mut().zip(axes) {
            *sum += f64::from(line.residual_squares);
        }
    }
    // A reading that never changes is no measurement.
    if scatter.iter().any(|&sum| sum <= 0.0) {
        return BaseMotion::Unknown;
    }
    let variance = scatter.map(|sum| sum / degrees_of_freedom);

    let Some(paths) = Paths::new(dwells, start_s) else { return BaseMotion::Unknown };
    // What each degree takes off the sum of squares beyond the scatter inside the dwells; both axes, in variances.
    let explained = |degree: usize| paths.explained(degree, variance);
    let degree = (1..DEGREES).rev().find(|&degree| explained(degree) > SIGNIFICANT).unwrap_or(0);
    let chi_square = paths.total(variance) - (0..=degree).map(explained).sum::<f64>();
    let with_slope = dwells.iter().filter(|dwell| dwell.time_spread > 0.0).count();
    let residual_degrees = 2.0 * (dwells.len() + with_slope) as f64 - 2.0 * (degree as f64 + 1.0);
    if residual_degrees > 0.0 && chi_square_z_score(chi_square, residual_degrees) > IMPROBABLE_SIGMAS {
        return BaseMotion::Moving(Method::Slopes { variance });
    }
    if degree == 0 {
        return BaseMotion::Still;
    }
    // One degree more than the data insist on: what is just not significant would else bias the rates.
    match paths.path((degree + 1).min(DEGREES - 1), variance) {
        Some(path) => BaseMotion::Moving(Method::Path(path)),
        None => BaseMotion::Unknown,
    }
}

/// The normal equations of the highest degree, factored once: the factor's leading part is that of every lower degree, and
/// the squares of the right-hand sides through it are what each degree takes off the sum of squares.
struct Paths {
    middle_s: f64,
    half_s: f64,
    /// Lower Cholesky factor L of the normal matrix.
    factor: SMatrix<f64, DEGREES, DEGREES>,
    /// L⁻¹ times the right-hand sides, pitch and roll.
    reduced: [SVector<f64, DEGREES>; 2],
    /// Weighted sums of squares, arcsec² · s.
    squares: [f64; 2],
}

impl Paths {
    /// `None` where the dwells do not determine a polynomial of the highest degree.
    fn new(dwells: &[DwellSummary], start_s: f64) -> Option<Self> {
        let half_s = 0.5 * (dwells.last()?.end_s - start_s);
        let middle_s = start_s + half_s;
        let mut normal = SMatrix::<f64, DEGREES, DEGREES>::zeros();
        let (mut right, mut squares) = ([SVector::<f64, DEGREES>::zeros(); 2], [0.0; 2]);
        for dwell in dwells {
            for (weight, row, values) in observations(dwell, middle_s, half_s) {
                normal += weight * row * row.transpose();
                for ((right, squares), value) in right.iter_mut().zip(&mut squares).zip(values) {
                    *right += weight * value * row;
                    *squares += weight * value * value;
                }
            }
        }
        let factor = normal.cholesky()?.l();
        // The square of a pivot is what of a power those before it do not explain.
        let pivots = factor.diagonal();
        if !pivots.iter().zip(normal.diagonal().iter()).all(|(pivot, whole)| pivot * pivot > LEAST_SHARE * whole) {
            return None;
        }
        let [pitch, roll] = right;
        let reduced = [factor.solve_lower_triangular(&pitch)?, factor.solve_lower_triangular(&roll)?];
        Some(Self { middle_s, half_s, factor, reduced, squares })
    }

    /// Sums of squares of both axes about zero, in variances.
    fn total(&self, variance: [f64; 2]) -> f64 {
        self.squares.iter().zip(variance).map(|(squares, variance)| squares / variance).sum()
    }

    /// What a degree takes off, in variances.
    fn explained(&self, degree: usize, variance: [f64; 2]) -> f64 {
        let of = |reduced: &SVector<f64, DEGREES>| reduced.get(degree).map_or(0.0, |entry| entry * entry);
        self.reduced.iter().zip(variance).map(|(reduced, variance)| of(reduced) / variance).sum()
    }

    /// The polynomials of a degree.
    fn path(&self, degree: usize, variance: [f64; 2]) -> Option<Path> {
        // The inverse of the leading part of L, with nothing beyond it.
        let mut leading = SMatrix::<f64, DEGREES, DEGREES>::identity();
        let part = (0..=degree, 0..=degree);
        leading.view_range_mut(part.0.clone(), part.1.clone()).copy_from(&self.factor.view_range(part.0, part.1));
        let mut inverse = leading.solve_lower_triangular(&SMatrix::<f64, DEGREES, DEGREES>::identity())?;
        inverse.rows_range_mut(degree + 1..).fill(0.0);
        Some(Path {
            middle_s: self.middle_s,
            half_s: self.half_s,
            coefficients: self.reduced.map(|reduced| inverse.tr_mul(&reduced)),
            covariance: variance.map(|variance| inverse.tr_mul(&inverse) * variance),
        })
    }
}

/// Two observations of a dwell: its mean (weight: seconds) and its slope (weight: time spread). The mean of a curved path
/// over a dwell differs from its value at the middle by the second moment; the powers are averaged over the dwell.
fn observations(dwell: &DwellSummary, middle_s: f64, half_s: f64) -> [(f64, SVector<f64, DEGREES>, [f64; 2]); 2] {
    let tilt = tilt_arcsec(dwell).unwrap_or_default();
    let half = 0.5 * (dwell.end_s - dwell.start_s) / half_s;
    let t = (dwell.t_s - middle_s) / half_s;
    // Means of (t + u)^k over u in ± half: 1, t, t² + h²/3, t³ + t·h², t⁴ + 2t²h² + h⁴/5.
    let h2 = half * half;
    let mean =
        SVector::from([1.0, t, t * t + h2 / 3.0, t * t * t + t * h2, t * t * t * t + 2.0 * t * t * h2 + h2 * h2 / 5.0]);
    // Least-squares slope of (t + u)^k over u in ± half: 3/(2h³) ∫ u (t + u)^k du.
    let slope = SVector::from([0.0, 1.0, 2.0 * t, 3.0 * t * t + 0.6 * h2, 4.0 * t * t * t + 2.4 * t * h2]) / half_s;
    [
        (dwell.seconds, mean, tilt.map(|line| line.mean)),
        (dwell.time_spread.into(), slope, tilt.map(|line| line.slope_per_s)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::dwell::{DwellRows, Row};
    use crate::level::LevelMoments;

    /// Eight dwells of 30 s, 8 s apart, on a base that tilts by `pitch_arcsec(t)`; the sensor's noise is a fixed zigzag
    /// with a spread of about 3 arcsec.
    fn dwells(pitch_arcsec: impl Fn(f64) -> f64) -> heapless::Vec<DwellSummary, 8> {
        let zigzag = |i: u32| f64::from((i * 7919 + 13) % 101) / 101.0 * 10.0 - 5.0;
        (0..8)
            .map(|dwell| {
                let mut rows = DwellRows::default();
                for second in 0..30 {
                    let t_s = f64::from(dwell * 38 + second) + 0.5;
                    let tilt = pitch_arcsec(t_s) + zigzag(dwell * 30 + second);
                    let level =
                        LevelMoments::constant(tilt / ARCSEC_PER_RAD, zigzag(dwell * 31 + second * 3) / ARCSEC_PER_RAD);
                    rows.push(
                        Row { t_s, seconds: 1.0, cos: 1.0, sin: 0.0, rate_deg_h: 0.0, moment_arcsec_s: 0.0, level },
                        1.0,
                    );
                }
                rows.summary(1.0).unwrap()
            })
            .collect()
    }

    #[test]
    fn a_still_base_is_left_alone() {
        assert_eq!(detect(&dwells(|_| 50.0)), BaseMotion::Still);
    }

    #[test]
    fn steady_creep_is_a_path_with_that_rate() {
        let dwells = dwells(|t_s| 0.1 * t_s);
        let BaseMotion::Moving(Method::Path(path)) = detect(&dwells) else { panic!() };
        for dwell in &dwells {
            let rate_deg_h = path.rates(dwell).dot(&path.coefficients()[0]);
            assert!((rate_deg_h - 0.1).abs() < 0.01, "{rate_deg_h}");
        }
    }

    #[test]
    fn decaying_creep_is_followed() {
        let dwells = dwells(|t_s| -20.0 * libm::exp(-t_s / 80.0));
        let BaseMotion::Moving(Method::Path(path)) = detect(&dwells) else { panic!() };
        // Over the first dwell, 0 … 30 s: 20 · (1 − e^(−30/80)) / 30 = 0.2085 arcsec/s.
        let rate_deg_h = path.rates(&dwells[0]).dot(&path.coefficients()[0]);
        assert!((rate_deg_h - 0.2085).abs() < 0.05, "{rate_deg_h}");
    }

    #[test]
    fn jumps_between_dwells_are_no_path() {
        let jumpy = dwells(|t_s| if (t_s as u32 / 38) % 3 == 1 { 400.0 } else { 0.0 });
        assert!(matches!(detect(&jumpy), BaseMotion::Moving(Method::Slopes { .. })));
    }

    #[test]
    fn without_accelerometers_nothing_is_said() {
        let mut silent = dwells(|_| 0.0);
        silent[3].level = None;
        assert_eq!(detect(&silent), BaseMotion::Unknown);
        assert_eq!(detect(&[]), BaseMotion::Unknown);
    }
}

//! Turning of the base during a fix, from the level accelerometers.
//!
//! A base that tilts adds cos θ · dr/dt − sin θ · dp/dt to what the indexed gyro reads: a first harmonic, just like the
//! azimuth itself, so no closure shows it. The accelerometers feel the same tilt. Two ways to use them:
//!
//! - *path*: the tilt over the whole fix as a polynomial in time, of one degree more than the data ask for (at most
//!   the fourth); the rate at each stay is its mean derivative. Precise, for a base that creeps smoothly.
//! - *slopes*: the tilt's slope inside each stay. For a base that jumps between stays, where a path has no meaning.
//!
//! Nothing is corrected unless the motion is significant, because the correction carries the accelerometers' noise.

use nalgebra::{SMatrix, SVector};

use super::dwell::{DwellSummary, Line};
use super::statistics::excess_sigmas;
use crate::units::ARCSEC_PER_RAD;

const DEGREES: usize = 5;
/// Time unit of the polynomial, seconds: the length of a fix, to keep the normal equations well conditioned.
const TIME_UNIT_S: f64 = 300.0;
/// A degree is taken when it lowers the sum of squares of both axes (two degrees of freedom) by this many variances:
/// by chance that happens once in e^(20/2) = 22 000 times.
const SIGNIFICANT: f64 = 20.0;
/// Excess of a chi-square, in standard deviations, that is not put down to chance.
const IMPROBABLE_SIGMAS: f64 = 4.0;

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
    start_s: f64,
    coefficients: [SVector<f64, DEGREES>; 2],
    /// Covariance of the coefficients of each axis.
    covariance: [SMatrix<f64, DEGREES, DEGREES>; 2],
}

/// Powers 0 … 4 of a time.
fn powers(t: f64) -> SVector<f64, DEGREES> {
    SVector::from([1.0, t, t * t, t * t * t, t * t * t * t])
}

impl Path {
    /// Mean derivative of the powers over a stay, 1/s.
    pub fn rates(&self, dwell: &DwellSummary) -> SVector<f64, DEGREES> {
        let at = |t_s: f64| powers((t_s - self.start_s) / TIME_UNIT_S);
        (at(dwell.end_s) - at(dwell.start_s)) / (dwell.end_s - dwell.start_s)
    }

    pub fn coefficients(&self) -> &[SVector<f64, DEGREES>; 2] {
        &self.coefficients
    }

    pub fn covariance(&self) -> &[SMatrix<f64, DEGREES, DEGREES>; 2] {
        &self.covariance
    }
}

/// Both axes of a stay in arcsec: pitch = forward, roll = left, for the small angles that the level limit allows.
fn tilt_arcsec(dwell: &DwellSummary) -> Option<[Line; 2]> {
    Some(dwell.level?.map(|line| Line {
        mean: line.mean * ARCSEC_PER_RAD,
        slope_per_s: line.slope_per_s * ARCSEC_PER_RAD,
        residual_squares: line.residual_squares * ARCSEC_PER_RAD * ARCSEC_PER_RAD,
        successive_squares: line.successive_squares * ARCSEC_PER_RAD * ARCSEC_PER_RAD,
    }))
}

/// Tilt rate (pitch, roll) inside one stay, arcsec/s, that is °/h.
pub fn slopes_deg_h(dwell: &DwellSummary) -> [f64; 2] {
    tilt_arcsec(dwell).map_or([0.0; 2], |axes| axes.map(|line| line.slope_per_s))
}

/// Looks for motion in the stays of a fix.
pub fn detect(dwells: &[DwellSummary]) -> BaseMotion {
    let freedom: f64 = dwells.iter().map(|dwell| f64::from(dwell.degrees_of_freedom)).sum();
    let (Some(start_s), true) = (dwells.first().map(|dwell| dwell.start_s), freedom >= 10.0) else {
        return BaseMotion::Unknown;
    };
    let mut scatter = [0.0; 2];
    for dwell in dwells {
        let Some(axes) = tilt_arcsec(dwell) else { return BaseMotion::Unknown };
        for (sum, line) in scatter.iter_mut().zip(axes) {
            *sum += line.residual_squares;
        }
    }
    // A reading that never changes is no measurement.
    if scatter.iter().any(|&sum| sum <= 0.0) {
        return BaseMotion::Unknown;
    }
    let variance = scatter.map(|sum| sum / freedom);

    // Sum of squares that is left with each degree, beyond the scatter inside the stays; both axes, in variances.
    let mut left = [0.0; DEGREES];
    for (degree, left) in left.iter_mut().enumerate() {
        match fit_path(dwells, start_s, degree, variance) {
            Some((_, chi_square)) => *left = chi_square,
            None => return BaseMotion::Unknown,
        }
    }
    let degree = (1..DEGREES)
        .rev()
        .find(|&degree| match (left.get(degree - 1), left.get(degree)) {
            (Some(lower), Some(higher)) => lower - higher > SIGNIFICANT,
            _ => false,
        })
        .unwrap_or(0);
    let with_slope = dwells.iter().filter(|dwell| dwell.time_spread > 0.0).count();
    let freedom_left = 2.0 * (dwells.len() + with_slope) as f64 - 2.0 * (degree as f64 + 1.0);
    let chi_square = left.get(degree).copied().unwrap_or(0.0);
    if freedom_left > 0.0 && excess_sigmas(chi_square, freedom_left) > IMPROBABLE_SIGMAS {
        return BaseMotion::Moving(Method::Slopes { variance });
    }
    if degree == 0 {
        return BaseMotion::Still;
    }
    // One degree more than the data insist on: what is just not significant would else bias the rates.
    match fit_path(dwells, start_s, (degree + 1).min(DEGREES - 1), variance) {
        Some((path, _)) => BaseMotion::Moving(Method::Path(path)),
        None => BaseMotion::Unknown,
    }
}

/// Weighted least squares of a polynomial through means and slopes of the stays, and the chi-square that it leaves.
fn fit_path(dwells: &[DwellSummary], start_s: f64, degree: usize, variance: [f64; 2]) -> Option<(Path, f64)> {
    let used = |mut row: SVector<f64, DEGREES>| {
        row.iter_mut().skip(degree + 1).for_each(|entry| *entry = 0.0);
        row
    };
    let mut normal = SMatrix::<f64, DEGREES, DEGREES>::zeros();
    let mut right = [SVector::<f64, DEGREES>::zeros(); 2];
    for (weight, row, values) in observations(dwells, start_s) {
        let row = used(row);
        normal += weight * row * row.transpose();
        for (right, value) in right.iter_mut().zip(values) {
            *right += weight * value * row;
        }
    }
    for unused in degree + 1..DEGREES {
        *normal.get_mut((unused, unused))? = 1.0;
    }
    let mut inverse = normal.cholesky()?.inverse();
    for unused in degree + 1..DEGREES {
        *inverse.get_mut((unused, unused))? = 0.0;
    }
    let coefficients = right.map(|right| inverse * right);
    let mut chi_square = 0.0;
    for (weight, row, values) in observations(dwells, start_s) {
        let row = used(row);
        for ((coefficients, value), variance) in coefficients.iter().zip(values).zip(variance) {
            let residual = value - row.dot(coefficients);
            chi_square += weight * residual * residual / variance;
        }
    }
    let covariance = variance.map(|variance| inverse * variance);
    Some((Path { start_s, coefficients, covariance }, chi_square))
}

/// Two observations a stay: its mean (weight: seconds) and its slope (weight: time spread). The mean of a curved path
/// over a stay differs from its value at the middle by the second moment; the powers are averaged over the stay.
fn observations(
    dwells: &[DwellSummary],
    start_s: f64,
) -> impl Iterator<Item = (f64, SVector<f64, DEGREES>, [f64; 2])> + '_ {
    dwells.iter().flat_map(move |dwell| {
        let tilt = tilt_arcsec(dwell).unwrap_or_default();
        let half = 0.5 * (dwell.end_s - dwell.start_s) / TIME_UNIT_S;
        let t = (dwell.t_s - start_s) / TIME_UNIT_S;
        // Means of (t + u)^k over u in ± half: 1, t, t² + h²/3, t³ + t·h², t⁴ + 2t²h² + h⁴/5.
        let h2 = half * half;
        let mean = SVector::from([
            1.0,
            t,
            t * t + h2 / 3.0,
            t * t * t + t * h2,
            t * t * t * t + 2.0 * t * t * h2 + h2 * h2 / 5.0,
        ]);
        // Least-squares slope of (t + u)^k over u in ± half: 3/(2h³) ∫ u (t + u)^k du.
        let slope =
            SVector::from([0.0, 1.0, 2.0 * t, 3.0 * t * t + 0.6 * h2, 4.0 * t * t * t + 2.4 * t * h2]) / TIME_UNIT_S;
        [
            (dwell.seconds, mean, tilt.map(|line| line.mean)),
            (dwell.time_spread, slope, tilt.map(|line| line.slope_per_s)),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::dwell::{DwellRows, Row};
    use crate::level::LevelMoments;

    /// Eight stays of 30 s, 8 s apart, on a base that tilts by `pitch_arcsec(t)`; the sensor's noise is a fixed zigzag
    /// with a spread of about 3 arcsec.
    fn dwells(pitch_arcsec: impl Fn(f64) -> f64) -> heapless::Vec<DwellSummary, 8> {
        let zigzag = |i: u32| f64::from((i * 7919 + 13) % 101) / 101.0 * 10.0 - 5.0;
        (0..8)
            .map(|stay| {
                let mut rows = DwellRows::default();
                for second in 0..30 {
                    let t_s = f64::from(stay * 38 + second) + 0.5;
                    let tilt = pitch_arcsec(t_s) + zigzag(stay * 30 + second);
                    let level =
                        LevelMoments::constant(tilt / ARCSEC_PER_RAD, zigzag(stay * 31 + second * 3) / ARCSEC_PER_RAD);
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
        // Over the first stay, 0 … 30 s: 20 · (1 − e^(−30/80)) / 30 = 0.2085 arcsec/s.
        let rate_deg_h = path.rates(&dwells[0]).dot(&path.coefficients()[0]);
        assert!((rate_deg_h - 0.2085).abs() < 0.05, "{rate_deg_h}");
    }

    #[test]
    fn jumps_between_stays_are_no_path() {
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

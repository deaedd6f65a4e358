//! The mean rate of a stay on a base that rocks and settles.
//!
//! About the sensitive axis the base turns by a(t) = cos θ · r(t) − sin θ · p(t), which the accelerometers feel as a tilt
//! and the gyro as the rate da/dt. The mean of ω − da/dt with the weight w(t) needs no derivative of the accelerometers:
//! by parts, ∫ w (ω − da/dt) dt = ∫ (w ω + dw/dt a) dt where w vanishes at both ends. The weight decides whose noise is
//! met best, as least squares would (for rows of equal length):
//!
//! - w = t (T − t): a straight line through the difference of gyro angle and accelerometer tilt, for tilt noise that is
//!   white;
//! - w = t² (T − t)²: a parabola through the integral of that difference, for noise that is white in the velocity:
//!   accelerometers that count velocity increments, and bases that are pushed to and fro.
//!
//! Sigma comes from the scatter about the line or the parabola.

use nalgebra::{Matrix3, Vector3};

use super::dwell::{DwellSummary, Line, Row};
use crate::units::ARCSEC_PER_RAD;

/// Rows belong together when the gap between them is below this, seconds.
const GAP_S: f64 = 0.01;
/// Fewest rows that give a rate.
const LEAST_ROWS: usize = 6;

/// The rows' summary, its rate free of the base's motion; `None` where too few rows follow each other without a gap or
/// the accelerometers are missing.
pub fn summary(rows: &[Row], velocity: bool) -> Option<DwellSummary> {
    let piece = longest_piece(rows);
    if piece.len() < LEAST_ROWS {
        return None;
    }
    let (first, last) = (piece.first()?, piece.last()?);
    let (start_s, end_s) = (first.t_s - 0.5 * first.seconds, last.t_s + 0.5 * last.seconds);
    let weights = Weights { start_s, length_s: end_s - start_s, velocity };

    let (mut weight, mut weighted_arcsec) = (0.0, 0.0);
    let (mut seconds, mut cos, mut sin, mut forward, mut left) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for row in piece {
        let level = row.level?;
        let (from_s, to_s) = (row.t_s - 0.5 * row.seconds, row.t_s + 0.5 * row.seconds);
        let of_row = weights.integral(to_s) - weights.integral(from_s);
        weight += of_row;
        let rise = weights.at(to_s) - weights.at(from_s);
        weighted_arcsec += of_row * row.rate_deg_h + rise * (row.lever_arcsec_s / row.seconds + tilt_arcsec(row)?);
        seconds += row.seconds;
        cos += row.seconds * row.cos;
        sin += row.seconds * row.sin;
        forward += row.seconds * level.forward;
        left += row.seconds * level.left;
    }
    let mean = weighted_arcsec / weight;
    let freedom = (piece.len() - 3) as u16;
    let scatter = variance(piece, &weights)? * seconds * f64::from(freedom);
    let still = |mean| Line { mean, ..Line::default() };
    Some(DwellSummary {
        seconds,
        t_s: 0.5 * (start_s + end_s),
        start_s,
        end_s,
        time_spread: 0.0,
        cos: cos / seconds,
        sin: sin / seconds,
        rate: Line { mean, slope_per_s: 0.0, scatter, neighbours: scatter },
        level: Some([still(forward / seconds), still(left / seconds)]),
        freedom,
        knocked: (rows.len() - piece.len()) as u16,
        moving: false,
        base_taken_out: true,
    })
}

/// The weight of a moment and its integral.
struct Weights {
    start_s: f64,
    length_s: f64,
    velocity: bool,
}

impl Weights {
    /// In [0, 1] of the stay's length.
    fn share(&self, t_s: f64) -> f64 {
        (t_s - self.start_s) / self.length_s
    }

    fn at(&self, t_s: f64) -> f64 {
        let u = self.share(t_s);
        let line = u * (1.0 - u);
        if self.velocity { line * line } else { line }
    }

    fn integral(&self, t_s: f64) -> f64 {
        let u = self.share(t_s);
        let u3 = u * u * u;
        let of_share = if self.velocity { u3 / 3.0 - u3 * u / 2.0 + u3 * u * u / 5.0 } else { u * u / 2.0 - u3 / 3.0 };
        of_share * self.length_s
    }
}

/// Turn of the base about the sensitive axis as the accelerometers feel it, arcsec.
fn tilt_arcsec(row: &Row) -> Option<f64> {
    let level = row.level?;
    Some((row.cos * level.left - row.sin * level.forward) * ARCSEC_PER_RAD)
}

/// The longest run of rows without a gap.
fn longest_piece(rows: &[Row]) -> &[Row] {
    let joined = |a: &Row, b: &Row| (b.t_s - 0.5 * b.seconds) - (a.t_s + 0.5 * a.seconds) < GAP_S;
    rows.chunk_by(joined).max_by_key(|piece| piece.len()).unwrap_or_default()
}

/// Variance of the mean rate, (°/h)²: from the scatter of the angle about a line (n rows over T: 12 s²/(n T²)) or of its
/// integral about a parabola (720 s²/(n T⁴)), more where neighbours scatter alike.
fn variance(rows: &[Row], weights: &Weights) -> Option<f64> {
    let powers = |u: f64| Vector3::new(1.0, u, if weights.velocity { u * u } else { 0.0 });
    let mut normal = Matrix3::zeros();
    if !weights.velocity {
        normal.m33 = 1.0;
    }
    let mut right = Vector3::zeros();
    for (t_s, value) in angles(rows, weights.velocity) {
        let row = powers(weights.share(t_s) - 0.5);
        normal += row * row.transpose();
        right += value * row;
    }
    let coefficients = normal.cholesky()?.solve(&right);
    let (mut squares, mut products, mut last) = (0.0, 0.0, None);
    for (t_s, value) in angles(rows, weights.velocity) {
        let residual = value - powers(weights.share(t_s) - 0.5).dot(&coefficients);
        squares += residual * residual;
        products += residual * last.replace(residual).unwrap_or(0.0);
    }
    let number = rows.len() as f64;
    let scatter = squares / (number - if weights.velocity { 3.0 } else { 2.0 });
    let alike = if squares > 0.0 { (products / squares).clamp(0.0, 0.9) } else { 0.0 };
    let length = weights.length_s;
    let factor = if weights.velocity { 720.0 / (length * length) } else { 12.0 };
    Some(factor * scatter / (number * length * length) * (1.0 + alike) / (1.0 - alike))
}

/// Gyro angle less tilt at the middle of each row, arcsec; or its integral at the end of each, arcsec·s.
fn angles(rows: &[Row], integrated: bool) -> impl Iterator<Item = (f64, f64)> + '_ {
    let (mut gyro_arcsec, mut integral) = (0.0, 0.0);
    rows.iter().map(move |row| {
        let turned = row.rate_deg_h * row.seconds;
        let mean_arcsec = gyro_arcsec + 0.5 * turned - row.lever_arcsec_s / row.seconds;
        let difference = mean_arcsec - tilt_arcsec(row).unwrap_or(0.0);
        gyro_arcsec += turned;
        integral += difference * row.seconds;
        if integrated { (row.t_s + 0.5 * row.seconds, integral) } else { (row.t_s, difference) }
    })
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::level::Specific;

    /// Forty seconds of a gyro that reads 3 °/h and the turning of a base that pitches by 400 arcsec · sin(t/3) and settles
    /// by 5 arcsec/s, at an index angle of 90°, where the axis points left: nose up is a negative turn about it.
    fn rows() -> Vec<Row> {
        let pitch = |t_s: f64| 400.0 * libm::sin(t_s / 3.0) + 5.0 * t_s;
        let mean = |t_s: f64| (-1200.0 * (libm::cos((t_s + 0.5) / 3.0) - libm::cos((t_s - 0.5) / 3.0))) + 5.0 * t_s;
        (0..40)
            .map(|second| {
                let t_s = f64::from(second) + 0.5;
                let rate_deg_h = 3.0 - (pitch(t_s + 0.5) - pitch(t_s - 0.5));
                // ∫ (t − middle) dp/dt dt = (p(end) + p(begin))/2 − mean.
                let lever_arcsec_s = -(0.5 * (pitch(t_s + 0.5) + pitch(t_s - 0.5)) - mean(t_s));
                let level = Specific::new(mean(t_s) / ARCSEC_PER_RAD, 0.0);
                Row { t_s, seconds: 1.0, cos: 0.0, sin: 1.0, rate_deg_h, lever_arcsec_s, level }
            })
            .collect()
    }

    #[test]
    fn rocking_and_settling_leave_the_rate() {
        // The tilt comes as means over a second, so ∫ dw/dt a dt lacks the part of each second's slope: what is left is
        // −1/12 s² ∫ w″ da/dt dt / ∫ w dt. With a = −400 sin(t/3) − 5 t over 40 s that is, for w = t (T − t), −(2/T²)/12 ·
        // (400 sin(40/3) + 200)/(T/6) = −0.0075 °/h, and for the squared weight, integrated twice by parts, the mean
        // of 400/27/12 · cos(t/3) with that weight, by numerical integration 0.0444 °/h.
        for (velocity, left_deg_h) in [(false, -0.0075), (true, 0.0444)] {
            let summary = summary(&rows(), velocity).unwrap();
            assert!((summary.rate.mean - 3.0 - left_deg_h).abs() < 1e-3, "{}", summary.rate.mean);
            assert!(summary.base_taken_out && summary.seconds == 40.0);
        }
    }

    #[test]
    fn sigma_is_that_of_the_scatter() {
        // A still base, accelerometers with ± 10 arcsec in turn: variance 100 about the line, 12 · 100/(40 · 1600).
        let mut rows = rows();
        for (i, row) in (0..).zip(&mut rows) {
            (row.rate_deg_h, row.lever_arcsec_s) = (3.0, 0.0);
            row.level = Specific::new(if i % 2 == 0 { 10.0 } else { -10.0 } / ARCSEC_PER_RAD, 0.0);
        }
        let sigma = summary(&rows, false).unwrap().sigma_deg_h();
        assert!((sigma - libm::sqrt(12.0 * 100.0 / (40.0 * 1600.0))).abs() < 0.1 * sigma, "{sigma}");
    }

    #[test]
    fn a_gap_ends_a_piece_and_missing_accelerometers_give_nothing() {
        let mut gap = rows();
        gap.remove(10);
        assert_eq!(summary(&gap, true).map(|summary| (summary.seconds, summary.knocked)), Some((29.0, 10)));
        let mut silent = rows();
        silent[3].level = None;
        assert!(summary(&silent, true).is_none());
    }
}

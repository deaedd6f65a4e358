//! The mean rate of a dwell on a base that rocks and settles.
//!
//! About the sensitive axis the base turns by a(t) = cos θ · r(t) − sin θ · p(t), which the accelerometers feel as a tilt
//! and the gyro as the rate da/dt. The mean of ω − da/dt with the weight w(t) needs no derivative of the accelerometers:
//! by parts, ∫ w (ω − da/dt) dt = ∫ (w ω + dw/dt a) dt where w vanishes at both ends. The weight decides whose noise is
//! met best. With white noise of σg² in the rate and σa² in the tilt (a second each) the variance σg² ∫ w² + σa² ∫ (dw/dt)²
//! is least where w − τ² d²w/dt² is constant, τ = σa/σg:
//!
//! - w = 1 − cosh((t − T/2)/τ) / cosh(T/2τ): nearly the plain mean where the gyro is the noisier, up to a few τ from the
//!   ends;
//! - w = t (T − t), its limit for a long τ: a straight line through the difference of gyro angle and accelerometer tilt,
//!   where the tilt is by far the noisier.
//!
//! Where the noise is in the velocity (accelerometers that count its increments, bases that are pushed to and fro) the rate
//! is twice the curvature of the integral of gyro angle less tilt: `super::velocity`.
//!
//! Over a row the weight is a parabola about its middle, so that mean and first moment of both sensors enter: the mean with
//! ∫ w, the first moment with the slope of w; of the tilt, the mean with the slope and the first moment with the slope of
//! the slope. Left out is the second moment of the gyro's rate, which no row keeps: of a base that rocks slowly against a
//! row it is nothing. The first moments matter for the noise: without that of the tilt only the velocities at the ends of
//! rows would count, of an accelerometer that is read a hundred times a second one reading in a hundred.
//!
//! Sigma comes from both noises and from the scatter of the rows' mean angles about a straight line, whichever is larger. With
//! a variance of s² for a mean over one second the slope of the line has 12 s²/T³.

use heapless::Vec;
use nalgebra::{Matrix2, Vector2};

use super::dwell::{DwellSummary, LevelLine, Line, MAX_ROWS, Row, longest_piece};
use super::velocity;
use crate::effects::BaseMotion;
use crate::units::ARCSEC_PER_RAD;

/// Lengths of a dwell beyond which a time constant is as good as infinite.
const LONGEST_TAU: f64 = 5.0;
/// Of the weight t² (T − t)² by which a parabola is curved: (∫ w)² over T ∫ w².
const SQUARED_PARABOLA: f64 = 0.7;
/// Fewest rows that give a rate.
const LEAST_ROWS: usize = velocity::LEAST_ROWS;

/// The rows' summary, its rate free of the base's motion; `None` where too few rows follow each other without a gap or
/// the accelerometers are missing. Where the tilt's noise is white in the tilt, `noise_deg_h`, the declared noise of a
/// one-second rate (0: unknown), is held against it.
pub fn summary(rows: &[Row], sensing: BaseMotion, noise_deg_h: f64) -> Option<DwellSummary> {
    let BaseMotion { velocity, lag_s } = sensing;
    let piece = longest_piece(rows);
    if piece.len() < LEAST_ROWS {
        return None;
    }
    let (first, last) = (piece.first()?, piece.last()?);
    let (start_s, end_s) = (first.t_s - 0.5 * first.seconds, last.t_s + 0.5 * last.seconds);
    let length_s = end_s - start_s;
    let tilt = Tilt { rows: piece, lag_s };
    let (mean, variance) = if velocity {
        let white = noise_deg_h * noise_deg_h / length_s / SQUARED_PARABOLA;
        let mut arcsec_s = Integrals::new();
        integrals(&tilt, &mut arcsec_s);
        let (mean, variance) = velocity::mean_rate(piece, &arcsec_s, start_s, length_s)?;
        (mean, variance.max(white))
    } else {
        weighted_mean(&tilt, start_s, length_s, noise_deg_h)?
    };
    let (mut seconds, mut cos, mut sin, mut forward, mut left) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for row in piece {
        let level = row.level?;
        seconds += row.seconds;
        cos += row.seconds * row.cos;
        sin += row.seconds * row.sin;
        forward += row.seconds * level.mean.forward;
        left += row.seconds * level.mean.left;
    }
    let degrees_of_freedom = (piece.len() - 3) as u16;
    let residual_squares = (variance * seconds * f64::from(degrees_of_freedom)) as f32;
    Some(DwellSummary {
        seconds,
        t_s: 0.5 * (start_s + end_s),
        start_s,
        end_s,
        time_spread: 0.0,
        cos: cos / seconds,
        sin: sin / seconds,
        rate: Line { mean, slope_per_s: 0.0, residual_squares, successive_squares: residual_squares },
        level: Some([forward, left].map(|sum| LevelLine::still(sum / seconds))),
        degrees_of_freedom,
        outliers: (rows.len() - piece.len()) as u16,
        base_taken_out: true,
        ..DwellSummary::default()
    })
}

/// Mean rate, °/h, by the weight that meets both noises best, and its variance.
fn weighted_mean(tilt: &Tilt<'_>, start_s: f64, length_s: f64, noise_deg_h: f64) -> Option<(f64, f64)> {
    let tilt_noise = tilt_noise_arcsec(tilt, noise_deg_h);
    let tau_s = (tilt_noise / noise_deg_h).max(2.0 * length_s / tilt.rows.len() as f64);
    let cosh = noise_deg_h > 0.0 && tau_s < LONGEST_TAU * length_s;
    let shape = if cosh { Shape::Cosh { tau_s } } else { Shape::Parabola };
    let weights = Weights { start_s, length_s, shape };
    let (mut weight, mut weighted_arcsec) = (0.0, 0.0);
    for (i, row) in tilt.iter().enumerate() {
        let (from_s, to_s) = (row.t_s - 0.5 * row.seconds, row.t_s + 0.5 * row.seconds);
        let before = weights.at(from_s);
        let after = weights.at(to_s);
        let until = weights.integral(to_s);
        let of_row = until - weights.integral(from_s);
        weight += of_row;
        let moment = row.moment_arcsec_s / row.seconds;
        weighted_arcsec += of_row * row.rate_deg_h + (after - before) * (moment + tilt.at(i)?);
        // ∫ dw/dt (t − middle) dt = d²w/dt² · seconds³/12 by parts, and the first moment of a straight line is its slope
        // times that cube's twelfth.
        let bend = (0.5 * row.seconds * (after + before) - of_row) / (row.seconds * row.seconds * row.seconds / 12.0);
        weighted_arcsec += bend * tilt.moment_arcsec_s2(i)?;
    }
    let of_scatter = variance(tilt, &weights)?;
    Some((weighted_arcsec / weight, of_scatter.max(weights.variance(noise_deg_h, tilt_noise))))
}

/// The weight of a moment and its integral.
struct Weights {
    start_s: f64,
    length_s: f64,
    shape: Shape,
}

/// How the weight goes over a dwell.
enum Shape {
    Cosh { tau_s: f64 },
    Parabola,
}

impl Weights {
    /// In [0, 1] of the dwell's length.
    fn share(&self, t_s: f64) -> f64 {
        (t_s - self.start_s) / self.length_s
    }

    fn at(&self, t_s: f64) -> f64 {
        let u = self.share(t_s);
        match self.shape {
            Shape::Cosh { tau_s } => {
                let x = self.length_s / tau_s;
                1.0 - over_cosh((u - 0.5) * x, 0.5 * x).0
            }
            Shape::Parabola => u * (1.0 - u),
        }
    }

    fn integral(&self, t_s: f64) -> f64 {
        let u = self.share(t_s);
        let of_share = match self.shape {
            Shape::Cosh { tau_s } => {
                let x = self.length_s / tau_s;
                u - over_cosh((u - 0.5) * x, 0.5 * x).1 / x
            }
            Shape::Parabola => u * u / 2.0 - u * u * u / 3.0,
        };
        of_share * self.length_s
    }

    /// Variance of the mean rate from white noise of the rate and of the tilt (of a second each), (°/h)²: by parts
    /// σg² ∫ w² + σa² ∫ (dw/dt)², over (∫ w)². Of the cosh weight w − τ² w″ is 1.
    fn variance(&self, rate_deg_h: f64, tilt_arcsec: f64) -> f64 {
        let (g2, a2, length) = (rate_deg_h * rate_deg_h, tilt_arcsec * tilt_arcsec, self.length_s);
        match self.shape {
            Shape::Cosh { tau_s } => {
                let x = 0.5 * length / tau_s;
                let (sech, tanh) = (over_cosh(0.0, x).0, over_cosh(x, x).1);
                let area = length * (1.0 - tanh / x);
                let slopes = (tanh - x * sech * sech) / tau_s;
                // ∫ w² = ∫ w + τ² ∫ w w″ = ∫ w − τ² ∫ (w′)².
                (g2 * (area - tau_s * tau_s * slopes) + a2 * slopes) / (area * area)
            }
            Shape::Parabola => 1.2 * g2 / length + 12.0 * a2 / (length * length * length),
        }
    }
}

/// Hyperbolic cosine and sine of `x` over the cosine of `z`, by the exponential function alone, which a board has anyway.
fn over_cosh(x: f64, z: f64) -> (f64, f64) {
    let (rising, falling) = (libm::exp(x - z), libm::exp(-x - z));
    let whole = 1.0 + libm::exp(-2.0 * z);
    ((rising + falling) / whole, (rising - falling) / whole)
}

/// Noise of a second's tilt about the sensitive axis, arcsec: what the differences of neighbours of gyro angle less tilt
/// have more than the gyro's own (2/3 of its variance in a second, the angles being means over one).
fn tilt_noise_arcsec(tilt: &Tilt<'_>, noise_deg_h: f64) -> f64 {
    let (mut last, mut sum, mut squares, mut count) = (None, 0.0, 0.0, 0.0);
    let mut angles = Angles::default();
    for i in 0..tilt.rows.len() {
        let angle = angles.next(tilt, i);
        if let Some(last) = last.replace(angle) {
            let step = angle - last;
            sum += step;
            squares += step * step;
            count += 1.0;
        }
    }
    let variance = (squares - sum * sum / count) / (count - 1.0);
    let seconds = tilt.iter().map(|row| row.seconds).sum::<f64>() / tilt.rows.len() as f64;
    // A reading of n seconds has an nth of the variance of a reading of one.
    let of_tilt = 0.5 * (variance - 2.0 / 3.0 * noise_deg_h * noise_deg_h * seconds) * seconds;
    libm::sqrt(of_tilt.max(0.0))
}

/// Turn of the base about the sensitive axis as the accelerometers feel it.
struct Tilt<'a> {
    rows: &'a [Row],
    lag_s: f64,
}

impl Tilt<'_> {
    fn iter(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter()
    }

    fn row(&self, i: usize) -> Option<&Row> {
        self.rows.get(i)
    }

    /// In the middle of row `i`, arcsec: between the readings of what is later by the lag by a straight line, beyond the
    /// last (or before the first) by its slope.
    fn at(&self, i: usize) -> Option<f64> {
        let row = self.row(i)?;
        let shift = self.lag_s / row.seconds;
        let near = ((i as f64 + libm::round(shift)).max(0.0) as usize).min(self.rows.len().saturating_sub(1));
        let later_s = row.t_s + self.lag_s - self.row(near)?.t_s;
        Some(self.reading_arcsec(near)? + later_s * self.slope_arcsec_s(near)?)
    }

    /// Slope of the readings about row `i`, arcsec/s.
    fn slope_arcsec_s(&self, i: usize) -> Option<f64> {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(self.rows.len() - 1));
        let apart_s = self.row(after)?.t_s - self.row(before)?.t_s;
        Some((self.reading_arcsec(after)? - self.reading_arcsec(before)?) / apart_s)
    }

    fn reading_arcsec(&self, i: usize) -> Option<f64> {
        let row = self.row(i)?;
        let level = row.level?;
        Some((row.cos * level.mean.left - row.sin * level.mean.forward) * ARCSEC_PER_RAD)
    }

    /// First moment of the turn over row `i`, arcsec · s².
    fn moment_arcsec_s2(&self, i: usize) -> Option<f64> {
        let row = self.row(i)?;
        let level = row.level?;
        Some((row.cos * level.first.left - row.sin * level.first.forward) * ARCSEC_PER_RAD)
    }
}

/// Variance of the mean rate, (°/h)², from the scatter of the rows' mean angles about a line; more where successive rows
/// scatter alike.
fn variance(tilt: &Tilt<'_>, weights: &Weights) -> Option<f64> {
    let powers = |t_s: f64| Vector2::new(1.0, weights.share(t_s) - 0.5);
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    let mut angles = Angles::default();
    for (i, row) in tilt.iter().enumerate() {
        let (value, of_row) = (angles.next(tilt, i), powers(row.t_s));
        normal += row.seconds * of_row * of_row.transpose();
        right += row.seconds * value * of_row;
    }
    let coefficients = normal.cholesky()?.solve(&right);
    let (mut squares, mut products, mut last) = (0.0, 0.0, None);
    let mut angles = Angles::default();
    for (i, row) in tilt.iter().enumerate() {
        let residual = angles.next(tilt, i) - powers(row.t_s).dot(&coefficients);
        squares += row.seconds * residual * residual;
        products += row.seconds * residual * last.replace(residual).unwrap_or(0.0);
    }
    let of_second = squares / (tilt.rows.len() as f64 - 2.0);
    // From the few rows of a dwell a correlation below nothing is not believed.
    let correlation = if squares > 0.0 { (products / squares).clamp(0.0, 0.9) } else { 0.0 };
    let length = weights.length_s;
    Some(12.0 * of_second / (length * length * length) * (1.0 + correlation) / (1.0 - correlation))
}

/// Gyro angle less tilt, row by row.
#[derive(Default)]
struct Angles {
    /// Gyro angle at the end of the last row, arcsec.
    gyro_arcsec: f64,
}

impl Angles {
    /// The mean over the next row, arcsec.
    fn next(&mut self, tilt: &Tilt, i: usize) -> f64 {
        let Some(row) = tilt.row(i) else { return 0.0 };
        let turned = row.rate_deg_h * row.seconds;
        let mean = self.gyro_arcsec + 0.5 * turned - row.moment_arcsec_s / row.seconds - tilt.at(i).unwrap_or(0.0);
        self.gyro_arcsec += turned;
        mean
    }
}

/// Integrals of gyro angle less tilt, the mean over each row, arcsec · s.
type Integrals = Vec<f64, MAX_ROWS>;

/// The integrals into `integrals`, which is empty. The gyro's rate is a straight line within a row.
fn integrals(tilt: &Tilt<'_>, integrals: &mut Integrals) {
    let (mut angles, mut integral) = (Angles::default(), 0.0);
    for (i, row) in tilt.iter().enumerate() {
        let turned = row.rate_deg_h * row.seconds;
        // Of a constant rate the angle grows as t and its integral as t²/2, with a mean of seconds²/6; of a rate that grows
        // evenly through the middle, the integral's mean is half of its end.
        let of_gyro = 0.5 * angles.gyro_arcsec + turned / 6.0 - 0.5 * row.moment_arcsec_s / row.seconds;
        let mean = angles.next(tilt, i);
        let of_tilt =
            0.5 * tilt.at(i).unwrap_or(0.0) - tilt.moment_arcsec_s2(i).unwrap_or(0.0) / (row.seconds * row.seconds);
        let arcsec_s = integral + row.seconds * (of_gyro - of_tilt);
        integral += mean * row.seconds;
        // There are no more of them than rows.
        let _ = integrals.push(arcsec_s);
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::sensing::level::LevelMoments;

    const VELOCITY: BaseMotion = BaseMotion { velocity: true, lag_s: 0.0 };

    /// Forty seconds of a gyro that reads 3 °/h and the turning of a base that pitches by 400 arcsec · sin(t/3) and settles
    /// by 5 arcsec/s, at an index angle of 90°, where the axis points left: nose up is a negative turn about it.
    fn rows() -> Vec<Row> {
        let pitch = |t_s: f64| 400.0 * libm::sin(t_s / 3.0) + 5.0 * t_s;
        let mean = |t_s: f64| (-1200.0 * (libm::cos((t_s + 0.5) / 3.0) - libm::cos((t_s - 0.5) / 3.0))) + 5.0 * t_s;
        // ∫ (t − middle) p dt, by parts: of the sine −1200 [(t − middle) cos] + 3600 [sin].
        let moment = |t_s: f64| {
            let at = |t_s: f64| t_s / 3.0;
            -600.0 * (libm::cos(at(t_s + 0.5)) + libm::cos(at(t_s - 0.5)))
                + 3600.0 * (libm::sin(at(t_s + 0.5)) - libm::sin(at(t_s - 0.5)))
                + 5.0 / 12.0
        };
        (0..40)
            .map(|second| {
                let t_s = f64::from(second) + 0.5;
                let rate_deg_h = 3.0 - (pitch(t_s + 0.5) - pitch(t_s - 0.5));
                // ∫ (t − middle) dp/dt dt = (p(end) + p(begin))/2 − mean.
                let moment_arcsec_s = -(0.5 * (pitch(t_s + 0.5) + pitch(t_s - 0.5)) - mean(t_s));
                let level = LevelMoments::constant(mean(t_s) / ARCSEC_PER_RAD, 0.0).map(|mut level| {
                    level.first.forward = moment(t_s) / ARCSEC_PER_RAD;
                    level
                });
                Row { t_s, seconds: 1.0, cos: 0.0, sin: 1.0, rate_deg_h, moment_arcsec_s, level }
            })
            .collect()
    }

    #[test]
    fn rocking_and_settling_leave_the_rate() {
        // What is left is the second moment of the gyro's rate, of a rocking of 19 s in rows of one: 400/3 °/h times a share of
        // (1/3)²/720 is 0.02 °/h where it does not average out, and it does over two periods.
        for velocity in [false, true] {
            let summary = summary(&rows(), BaseMotion { velocity, lag_s: 0.0 }, 0.0).unwrap();
            assert!((summary.rate.mean - 3.0).abs() < 1e-3, "{}", summary.rate.mean);
            assert!(summary.base_taken_out && summary.seconds == 40.0);
        }
    }

    /// Readings of the end of each second instead of means over it are half a second early.
    #[test]
    fn readings_that_come_at_another_time() {
        let mut rows = rows();
        for row in &mut rows {
            let end_s = row.t_s + 0.5;
            row.level = LevelMoments::constant((400.0 * libm::sin(end_s / 3.0) + 5.0 * end_s) / ARCSEC_PER_RAD, 0.0);
        }
        let missed = |lag_s| summary(&rows, BaseMotion { velocity: false, lag_s }, 0.0).unwrap().rate.mean - 3.0;
        assert!(missed(-0.5).abs() < 0.2, "{}", missed(-0.5));
        assert!(missed(0.0).abs() > 3.0 * missed(-0.5).abs(), "{}", missed(0.0));
    }

    #[test]
    fn sigma_is_that_of_the_scatter() {
        // A still base, accelerometers with ± 10 arcsec, twice in turn as in white noise: variance 100 about the line,
        // 12 · 100/(40 · 1600).
        let mut rows = rows();
        for (i, row) in (0..).zip(&mut rows) {
            (row.rate_deg_h, row.moment_arcsec_s) = (3.0, 0.0);
            row.level = LevelMoments::constant(if i % 4 < 2 { 10.0 } else { -10.0 } / ARCSEC_PER_RAD, 0.0);
        }
        let sigma = summary(&rows, BaseMotion::default(), 0.0).unwrap().sigma_deg_h();
        assert!((sigma - libm::sqrt(12.0 * 100.0 / (40.0 * 1600.0))).abs() < 0.1 * sigma, "{sigma}");
    }

    /// By numerical integration of w = 1 − cosh((t − 10)/5)/cosh 2 over 20 s: ∫ w = 10.3597, ∫ w² = 6.24609, ∫ w′² = 0.164545.
    #[test]
    fn variance_of_the_cosh_weight() {
        let weights = Weights { start_s: 0.0, length_s: 20.0, shape: Shape::Cosh { tau_s: 5.0 } };
        assert!((weights.integral(20.0) - weights.integral(0.0) - 10.3597).abs() < 1e-4);
        assert!((weights.variance(1.0, 0.0) - 6.24609 / 10.3597 / 10.3597).abs() < 1e-5);
        assert!((weights.variance(0.0, 1.0) - 0.164545 / 10.3597 / 10.3597).abs() < 1e-6);
        // A parabola is what is left of it in the limit.
        let flat = |shape| Weights { start_s: 0.0, length_s: 20.0, shape }.variance(1.0, 2.0);
        assert!((flat(Shape::Cosh { tau_s: 100.0 }) / flat(Shape::Parabola) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_quiet_tilt_leaves_nearly_the_plain_mean() {
        // No tilt noise at all: τ is two rows, and a rate that is 1 °/h higher in the middle half counts half.
        let mut rows = rows();
        for (i, row) in (0..).zip(&mut rows) {
            row.rate_deg_h = if (10..30).contains(&i) { 4.0 } else { 3.0 };
            (row.moment_arcsec_s, row.level) = (0.0, LevelMoments::constant(0.0, 0.0));
        }
        let mean = |noise_deg_h| summary(&rows, BaseMotion::default(), noise_deg_h).unwrap().rate.mean;
        assert!((mean(10.0) - 3.5).abs() < 0.06, "{}", mean(10.0));
        // Of unknown noise the parabola is taken: 11/16 lies in the middle half.
        assert!((mean(0.0) - 3.6875).abs() < 1e-9);
    }

    #[test]
    fn a_gap_ends_a_piece_and_missing_accelerometers_give_nothing() {
        let mut gap = rows();
        gap.remove(10);
        assert_eq!(summary(&gap, VELOCITY, 0.0).map(|summary| (summary.seconds, summary.outliers)), Some((29.0, 10)));
        let mut silent = rows();
        silent[3].level = None;
        assert!(summary(&silent, VELOCITY, 0.0).is_none());
    }
}

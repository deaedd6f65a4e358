//! The noise of a fix, as its dwells show it: white in the rate, white in the angle, or wandering.
//!
//! White noise of the rate has a variance of σw²/T in the mean of a dwell of T seconds. A ring laser, or a gyro that counts
//! more coarsely than it is noisy, errs in the *angle* instead: what one second reads too much the next one lacks, and
//! successive rates are anticorrelated. The plain mean then depends on the angles at both ends of the dwell alone, with a
//! variance of σw²/T + 2 σe²/T². Better is the slope of a straight line through the mean angles of all seconds, which weighs
//! the rates with a parabola, t (T − t): σw² 6/(5 T) + 12 σa²/T³. (The line is the best unbiased estimate for noise that is
//! white in the angle, the plain mean for noise that is white in the rate.) Each dwell gives the one that is the better by
//! these variances.
//!
//! The two variances come from the mean angles about their lines. White angles scatter with σa²; white rates make the angle
//! a random walk, which scatters about its line with σw² T/15 (a Brownian path less its least-squares line), while half the
//! mean square of the differences of mean angles is σa² + σw²/3. The difference of these two sums gives σw², where it is
//! significant, and the rest σa²; else the declared noise is σw². The
//! angle at a single moment, σe², comes from the autocovariance of the rates, −σe².
//!
//! Successive rates that are alike widen the variance by (1 + ρ)/(1 − ρ), ρ their correlation, as for an autoregressive
//! process of the first order.

use super::dwell::{DwellSummary, Trend};

/// A correlation of successive rates this many standard deviations from nothing is believed.
const CORRELATION_SIGMAS: f64 = 4.0;
/// The largest correlation that is reckoned with.
const MOST_ALIKE: f64 = 0.98;
/// A random walk of the angle that is this many standard deviations above nothing is believed.
const WALK_SIGMAS: f64 = 2.0;
/// Least share of the random walk in the scatter of the angle that lets it be told from white angles.
const LEAST_WALK: f64 = 0.5;
/// Weight of a dwell's own variance beside that of all dwells, on a moving base.
const OWN: f64 = 1.0 / 3.0;

/// What the dwells of a fix show together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Variance of a one-second rate, (°/h)², at least the declared one.
    pub variance: f64,
    /// White noise of the rate alone, (°/h)² · s, before it is held against the declared one.
    pub white: f64,
    /// By how much the variance of a mean exceeds that of white noise, because successive rates are alike; at least 1.
    pub widening: f64,
    angle: Option<AngleNoise>,
}

/// Noise that is white in the angle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AngleNoise {
    /// White noise of the rate beside it, (°/h)² · s.
    white: f64,
    /// Variance of the mean angle of a second, and of the angle at one moment, arcsec².
    of_second: f64,
    of_moment: f64,
}

/// Residual sums of squares of all dwells, and their degrees of freedom.
#[derive(Default)]
struct Pooled {
    residual: f64,
    successive: f64,
    degrees_of_freedom: f64,
    seconds: f64,
}

impl Pooled {
    fn new<'a>(
        dwells: impl Iterator<Item = &'a DwellSummary>,
        line: fn(&DwellSummary) -> Option<Trend>,
    ) -> Option<Self> {
        let mut pooled = Self::default();
        for dwell in dwells.filter(|dwell| dwell.degrees_of_freedom > 0) {
            let line = line(dwell)?;
            let degrees_of_freedom = f64::from(dwell.degrees_of_freedom);
            pooled.residual += f64::from(line.residual_squares);
            pooled.successive += f64::from(line.successive_squares);
            pooled.degrees_of_freedom += degrees_of_freedom;
            pooled.seconds += degrees_of_freedom * dwell.seconds;
        }
        (pooled.degrees_of_freedom > 0.0).then_some(pooled)
    }
}

impl Noise {
    /// From the dwells of a fix; `declared_deg_h` is the declared noise of a one-second rate. Where the dwells have too few rows to tell it,
    /// it is `of_successive_residuals`, the variance of a one-second rate; `None` where nothing tells it.
    pub fn new<'a>(
        dwells: impl Iterator<Item = &'a DwellSummary> + Clone,
        declared_deg_h: f64,
        of_successive_residuals: impl FnOnce() -> Option<f64>,
    ) -> Option<Self> {
        let declared = declared_deg_h * declared_deg_h;
        let rates = Pooled::new(dwells.clone(), |dwell| Some(dwell.rate.into()));
        let Some(rates) = rates.filter(|rates| rates.degrees_of_freedom >= 4.0) else {
            let white = of_successive_residuals()?;
            return Some(Self {
                variance: white.max(declared).max(f64::MIN_POSITIVE),
                white,
                widening: 1.0,
                angle: None,
            });
        };
        let observed = rates.residual / rates.degrees_of_freedom;
        let correlation = if rates.residual > 0.0 { 1.0 - rates.successive / rates.residual } else { 0.0 };
        // In white noise the correlation has a variance of one over the number of rows.
        let sigmas = correlation * libm::sqrt(rates.degrees_of_freedom);
        let alike = if sigmas > CORRELATION_SIGMAS { correlation.min(MOST_ALIKE) } else { 0.0 };
        let angles = Pooled::new(dwells, |dwell| dwell.angle);
        let angle = angles
            .filter(|_| sigmas < -CORRELATION_SIGMAS)
            .and_then(|angles| AngleNoise::new(&angles, -correlation * observed));
        Some(Self {
            variance: observed.max(declared).max(f64::MIN_POSITIVE),
            white: angle.map_or(observed, |angle| angle.white),
            widening: (1.0 + alike) / (1.0 - alike),
            angle: angle.map(|angle| AngleNoise { white: angle.white.max(declared), ..angle }),
        })
    }

    /// The best mean rate of a dwell, °/h, and its weight: the variance of a one-second rate over that of the mean.
    pub fn mean(&self, dwell: &DwellSummary) -> (f64, f64) {
        let plain = (dwell.rate.mean, dwell.seconds);
        // On a moving base some dwells are disturbed and others are not. But errors that are alike over seconds tell a
        // dwell's variance only roughly.
        if dwell.base_taken_out && dwell.degrees_of_freedom > 0 && dwell.seconds > 0.0 {
            let own = dwell.sigma_deg_h() * dwell.sigma_deg_h();
            let variance = OWN * own + (1.0 - OWN) * self.variance / dwell.seconds;
            return (dwell.rate.mean, self.variance / variance);
        }
        let (Some(noise), Some(angle), true) = (self.angle, dwell.angle, dwell.seconds > 0.0) else { return plain };
        let (length, squared) = (dwell.seconds, dwell.seconds * dwell.seconds);
        let of_mean = noise.white / length + 2.0 * noise.of_moment / squared;
        let of_line = 1.2 * noise.white / length + 12.0 * noise.of_second / (squared * length);
        let (mean, variance) = if of_line < of_mean { (angle.slope_per_s, of_line) } else { (plain.0, of_mean) };
        if variance > 0.0 { (mean, self.variance / variance) } else { plain }
    }

    /// The weight of a dwell's slope, s³: the variance of a one-second rate over that of the slope. By parts the slope's
    /// weights of the rates, 12 (t − T/2)/T³, are 12/T³ of the angles and 6/T² of those at the ends.
    pub fn weight_of_slope(&self, dwell: &DwellSummary) -> f64 {
        let time_spread = f64::from(dwell.time_spread);
        let (Some(noise), true) = (self.angle, time_spread > 0.0) else { return time_spread };
        let squared = dwell.seconds * dwell.seconds;
        let of_angle = noise.of_moment * (72.0 + 144.0 / dwell.seconds) / (squared * squared);
        self.variance / (noise.white / time_spread + of_angle)
    }
}

impl AngleNoise {
    fn new(angles: &Pooled, of_moment: f64) -> Option<Self> {
        let walk = angles.seconds / angles.degrees_of_freedom / 15.0 - 1.0 / 3.0;
        if walk < LEAST_WALK {
            return None;
        }
        let (about_line, of_steps) =
            (angles.residual / angles.degrees_of_freedom, angles.successive / angles.degrees_of_freedom);
        // Where the angles do not show a walk, the declared noise stands for it.
        let sigmas = (1.0 - angles.successive / angles.residual) * libm::sqrt(angles.degrees_of_freedom);
        let white = if sigmas > WALK_SIGMAS { (about_line - of_steps) / walk } else { 0.0 };
        let of_second = (of_steps - white / 3.0).max(0.0);
        Some(Self { white, of_second, of_moment: of_moment.max(of_second) })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use crate::earth::{EarthRate, earth_rate};
    use crate::effects::ErrorModel;
    use crate::fix::Declared;
    use crate::fix::dwell::{DwellRows, DwellSummary, Row};
    use crate::fix::solve;
    use crate::fix::tests::normal;
    use crate::sensing::sample::GyroSettings;
    use crate::units::{sin_cos_deg, wrap_180_deg};

    const FIXES: u64 = 300;

    /// Mean square of the azimuth's error over its sigma, rms error and rms sigma, degrees, of four positions of 60 s at 40°
    /// north and azimuth 30°, for noise of `white_deg_h` in a one-second rate and of `angle_arcsec` in every angle.
    fn errors(white_deg_h: f64, angle_arcsec: f64) -> (f64, f64, f64) {
        let earth: EarthRate = earth_rate(40.0).unwrap();
        let gyro = GyroSettings {
            arw_deg_per_sqrt_h: white_deg_h / 60.0,
            bias_instability_deg_h: 0.0,
            drift_deg_h_per_h: 0.0,
            ..Default::default()
        };
        let declared = Declared {
            earth,
            gyro,
            index_sigma_deg: 0.0,
            level_sigma_deg: 0.0,
            calibrated: true,
            level_calibrated: true,
            level_drift: crate::sensing::level::LevelDrift::default(),
        };
        let mut state = 5;
        let mut normal = || normal(&mut state);
        let (mut ratio, mut error, mut sigma) = (0.0, 0.0, 0.0);
        for _ in 0..FIXES {
            let dwells: Vec<DwellSummary> = (0..4)
                .map(|position| {
                    let (sin, cos) = sin_cos_deg(90.0 * f64::from(position));
                    let rate_deg_h = earth.north_deg_h * libm::cos((30.0 - 90.0 * f64::from(position)).to_radians());
                    let mut rows = DwellRows::default();
                    // Quarters of a second, so that the mean angle is of four readings.
                    let mut last = angle_arcsec * normal();
                    for second in 0..60 {
                        let (mut angle, mut moment) = (0.0, 0.0);
                        for quarter in 0..4 {
                            let reading = angle_arcsec * normal();
                            let turned = 0.25 * rate_deg_h + 0.5 * white_deg_h * normal() + reading - last;
                            last = reading;
                            angle += turned;
                            moment += turned * (0.25 * f64::from(quarter) - 0.375);
                        }
                        let t_s = f64::from(70 * position + second) + 0.5;
                        let row = Row {
                            t_s,
                            seconds: 1.0,
                            cos,
                            sin,
                            rate_deg_h: angle,
                            moment_arcsec_s: moment,
                            level: None,
                        };
                        rows.push(row, white_deg_h);
                    }
                    rows.summary(white_deg_h).unwrap()
                })
                .collect();
            let fix = solve(&dwells, &declared, &ErrorModel::default()).unwrap();
            let miss_deg = wrap_180_deg(fix.azimuth_deg - 30.0);
            ratio += miss_deg * miss_deg / (fix.sigma_deg * fix.sigma_deg) / FIXES as f64;
            error += miss_deg * miss_deg / FIXES as f64;
            sigma += fix.sigma_deg * fix.sigma_deg / FIXES as f64;
        }
        (ratio, error.sqrt(), sigma.sqrt())
    }

    /// White noise of the rate of 0.02 °/h in a second, alone and under 0.1, 0.5 and 2 arcsec of the angle. The mean square of
    /// 300 errors in sigmas has a standard deviation of √(2/300) = 0.08: four of them either way, and a fifth for the sigma's
    /// own uncertainty. White noise of the scatter would give a sigma of √2 · 2 arcsec/√240 for 2 arcsec, in the Earth's 11.52
    /// °/h √2 · 0.18/11.5 rad = 1.28°; the ends of each dwell √2 · √2 · 2/60/√2/11.5 rad = 0.23°; the line through the
    /// angles, of which four make a mean, less than half of that.
    #[test]
    fn sigma_covers_noise_of_rate_and_angle() {
        for angle_arcsec in [0.0, 0.1, 0.5, 2.0] {
            let (ratio, error_deg, sigma_deg) = errors(0.02, angle_arcsec);
            std::println!("{angle_arcsec} arcsec: {ratio:.3}, {error_deg:.4}°, {sigma_deg:.4}°");
            assert!((ratio - 1.0).abs() < 4.0 * 0.082 + 0.2, "{angle_arcsec}: {ratio}");
            if angle_arcsec == 2.0 {
                assert!(error_deg < 0.12, "{error_deg}");
            }
        }
    }
}

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
//! An angle noise that is declared ([`GyroSettings::angle_noise_arcsec`]) is reckoned with in every fix; the dwells say how much more there is.
//!
//! Successive rates that are alike widen the variance by (1 + ρ)/(1 − ρ), ρ their correlation, as for an autoregressive
//! process of the first order.
//!
//! Where the drive rings when the dwells begin, each gives the mean into which its first second enters gradually ([`super::dwell::Eased`]): the first
//! seconds then turn more unevenly than the others.
//!
//! Where the seconds have heavy tails, each dwell gives its robust mean ([`super::robust`]), and where the dwells' variances differ, each its
//! own weight. Both only where the means of blocks do not contradict it: sway, which the plain mean cancels, has large seconds too.

use super::dwell::{DwellSummary, Line, Robust, Trend};
use super::robust::Blocks;
use super::statistics::chi_square_z_score;
use crate::effects::ErrorModel;
use crate::sensing::sample::GyroSettings;

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

/// Tails are heavy where all dwells together make them so many times (its logarithm) as likely as normal ones: 20 times, strong evidence
/// by Jeffreys (Theory of Probability, 1961, appendix B). Of normal noise of 240 s the logarithm is −10 ± 3
/// (`gaussian_noise_keeps_the_plain_mean`).
const HEAVY_TAILS: f64 = 3.0;
/// Fewest pairs of blocks that tell whether the noise cancels.
const LEAST_PAIRS: f64 = 8.0;
/// The drive rings where the first seconds turn more unevenly than the others by this many standard deviations of the ratio of their variances.
const RINGS_SIGMAS: f64 = 4.0;
/// Noise cancels where blocks differ by less than this share of what white noise makes of them: sway of 0.23 Hz, whose seconds are not correlated,
/// has 0.25, and white noise 1 ± 0.27 with the 40 pairs of 240 s.
const CANCELS: f64 = 0.6;
/// Blocks of robust means have less than this share of the variance of plain ones: Student's t has 0.7, with two degrees of freedom.
const ROBUST_BLOCKS: f64 = 0.95;
/// Dwells have variances of their own from this many standard deviations of their chi-square on.
const OWN_SIGMAS: f64 = 3.0;
/// Beside a dwell's own variance that of all dwells counts as much as so many of its seconds: a variance of n seconds is known to √(2/n), and
/// a weight that errs by 50 % costs a mean 6 % of its variance.
const SHARED_SECONDS: f64 = 8.0;

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
    /// Each dwell gives the mean into which its first second enters gradually.
    eased: bool,
    /// Each dwell gives its robust mean, …
    robust: bool,
    /// … with the weight of its own variance.
    by_dwell: bool,
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
        line: impl Fn(&DwellSummary) -> Option<Trend>,
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

    /// Share of the variance of white rates in the scatter of the angle about its line beyond that in its differences.
    fn walk(&self) -> f64 {
        self.seconds / self.degrees_of_freedom / 15.0 - 1.0 / 3.0
    }

    fn variance(&self) -> f64 {
        self.residual / self.degrees_of_freedom
    }

    /// Correlation of successive ones.
    fn correlation(&self) -> f64 {
        if self.residual > 0.0 { 1.0 - self.successive / self.residual } else { 0.0 }
    }

    /// In its standard deviations: in white noise it has a variance of one over the number of rows.
    fn correlation_sigmas(&self) -> f64 {
        self.correlation() * libm::sqrt(self.degrees_of_freedom)
    }
}

/// Logarithm of how much more likely heavy tails are than normal ones.
fn evidence<'a>(dwells: impl Iterator<Item = &'a DwellSummary>) -> f64 {
    dwells.filter_map(|dwell| dwell.robust).map(|robust| f64::from(robust.evidence)).sum()
}

/// Whether the noise, of this variance of a one-second rate, cancels in the blocks of plain means, or differs in them little more than in those of
/// robust ones; or they are too few to tell.
fn is_sway<'a>(dwells: impl Iterator<Item = &'a DwellSummary> + Clone, variance: f64) -> bool {
    let sum = |blocks: fn(&Robust) -> Blocks| {
        let of_dwells = dwells.clone().filter_map(|dwell| dwell.robust.as_ref().map(blocks));
        of_dwells.fold((0.0, 0.0), |(squares, pairs), of_dwell| {
            (squares + f64::from(of_dwell.squares), pairs + f64::from(of_dwell.pairs))
        })
    };
    let ((plain, pairs), (robust, _)) = (sum(|robust| robust.plain_blocks), sum(|robust| robust.blocks));
    pairs < LEAST_PAIRS || plain < CANCELS * variance * pairs || ROBUST_BLOCKS * plain <= robust
}

/// Whether the drive rings where the dwells begin: by the ratio of the variances of the first rows and of the others, whose cube root is about normal
/// (Paulson, Ann. Math. Stat. 13, 1942, p. 233).
fn rings<'a>(dwells: impl Iterator<Item = &'a DwellSummary>) -> bool {
    let (mut first, mut others, mut dwells_eased, mut rows) = (0.0, 0.0, 0.0, 0.0);
    for dwell in dwells {
        let Some(eased) = dwell.eased else { continue };
        first += f64::from(eased.first);
        others += f64::from(eased.others);
        dwells_eased += 1.0;
        rows += f64::from(dwell.degrees_of_freedom) + 1.0;
    }
    if others <= 0.0 {
        return false;
    }
    let root = libm::cbrt(first / dwells_eased / (others / rows));
    let (of_first, of_others) = (2.0 / (9.0 * dwells_eased), 2.0 / (9.0 * rows));
    (1.0 - of_others) * root - (1.0 - of_first) > RINGS_SIGMAS * libm::sqrt(of_first + of_others * root * root)
}

/// The line of a dwell's rate, eased in or plain.
fn rate(dwell: &DwellSummary, eased: bool) -> Line {
    dwell.eased.filter(|_| eased).map_or(dwell.rate, |eased| eased.line)
}

/// Whether the robust variances of the dwells differ, by Bartlett's test (Proc. R. Soc. Lond. A 160, 1937, p. 268).
fn variances_differ<'a>(dwells: impl Iterator<Item = &'a DwellSummary>) -> bool {
    let (mut number, mut freedoms, mut reciprocals, mut squares, mut logarithms) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for dwell in dwells {
        let (Some(robust), true) = (dwell.robust, dwell.degrees_of_freedom > 0) else { continue };
        let (residual, freedom) = (f64::from(robust.line.residual_squares), f64::from(dwell.degrees_of_freedom));
        number += 1.0;
        freedoms += freedom;
        reciprocals += 1.0 / freedom;
        squares += residual;
        logarithms += freedom * libm::log((residual / freedom).max(f64::MIN_POSITIVE));
    }
    if number < 2.0 || squares <= 0.0 {
        return false;
    }
    let correction = 1.0 + (reciprocals - 1.0 / freedoms) / (3.0 * (number - 1.0));
    let chi_square = (freedoms * libm::log(squares / freedoms) - logarithms) / correction;
    chi_square_z_score(chi_square, number - 1.0) > OWN_SIGMAS
}

fn squared(value: f64) -> f64 {
    value * value
}

impl Noise {
    /// From the dwells of a fix, and what is declared of the gyro. Where the dwells have too few rows to tell it,
    /// it is `of_successive_residuals`, the variance of a one-second rate; `None` where nothing tells it.
    pub fn new<'a>(
        dwells: impl Iterator<Item = &'a DwellSummary> + Clone,
        gyro: &GyroSettings,
        of_successive_residuals: impl FnOnce() -> Option<f64>,
    ) -> Option<Self> {
        let (declared, declared_white) = (squared(gyro.noise_deg_h()), squared(gyro.white_noise_deg_h()));
        let eased = rings(dwells.clone());
        let plain = Pooled::new(dwells.clone(), |dwell| Some(rate(dwell, eased).into()));
        let Some(plain) = plain.filter(|plain| plain.degrees_of_freedom >= 4.0) else {
            let white = of_successive_residuals()?;
            return Some(Self {
                variance: white.max(declared).max(f64::MIN_POSITIVE),
                white,
                widening: 1.0,
                angle: None,
                eased,
                robust: false,
                by_dwell: false,
            });
        };
        let heavy = Pooled::new(dwells.clone(), |dwell| dwell.robust.map(|robust| robust.line.into()))
            .filter(|_| evidence(dwells.clone()) > HEAVY_TAILS && !is_sway(dwells.clone(), plain.variance()))
            .filter(|_| !eased && plain.correlation_sigmas() < CORRELATION_SIGMAS);
        let (robust, rates) = (heavy.is_some(), heavy.unwrap_or(plain));
        let (observed, correlation) = (rates.variance(), rates.correlation());
        // What rings is in the rates of the first seconds, and not in their mean angles, whose steps have σw²/3 of white noise (and all of an angle's).
        let angles = if eased { Pooled::new(dwells.clone(), |dwell| dwell.angle) } else { None };
        let of_steps = angles.map(|angles| 3.0 * angles.successive / angles.degrees_of_freedom);
        let observed = of_steps.map_or(observed, |of_steps| of_steps.min(observed));
        let sigmas = rates.correlation_sigmas();
        let alike = if sigmas > CORRELATION_SIGMAS { correlation.min(MOST_ALIKE) } else { 0.0 };
        let seen_arcsec2 = if sigmas < -CORRELATION_SIGMAS { -correlation * observed } else { 0.0 };
        let angle = if robust { None } else { AngleNoise::new(dwells.clone(), seen_arcsec2, gyro) };
        Some(Self {
            variance: observed.max(declared).max(f64::MIN_POSITIVE),
            white: angle.map_or(observed, |angle| angle.white),
            widening: (1.0 + alike) / (1.0 - alike),
            angle: angle.map(|angle| AngleNoise { white: angle.white.max(declared_white), ..angle }),
            eased,
            robust,
            by_dwell: robust && variances_differ(dwells),
        })
    }

    /// The same for a fix with this model. Where the rates change within dwells by what is known only with the azimuth, it is from the steps between
    /// successive seconds, to which slow changes add little: a step of white rates has twice their variance.
    pub fn with<'a>(
        model: &ErrorModel,
        dwells: impl Iterator<Item = &'a DwellSummary> + Clone,
        gyro: &GyroSettings,
        of_successive_residuals: impl FnOnce() -> Option<f64>,
    ) -> Option<Self> {
        let plain = Pooled::new(dwells.clone(), |dwell| Some(dwell.rate.into())).filter(|_| model.remembers_rate());
        let Some(plain) = plain else { return Self::new(dwells, gyro, of_successive_residuals) };
        let white = plain.successive / plain.degrees_of_freedom;
        let variance = white.max(squared(gyro.noise_deg_h())).max(f64::MIN_POSITIVE);
        Some(Self { variance, white, widening: 1.0, angle: None, eased: false, robust: false, by_dwell: false })
    }

    /// The best mean rate of a dwell, °/h, and its weight: the variance of a one-second rate over that of the mean.
    pub fn mean(&self, dwell: &DwellSummary) -> (f64, f64) {
        let plain = (rate(dwell, self.eased).mean, dwell.seconds);
        if let (true, Some(robust)) = (self.robust, dwell.robust) {
            return (robust.line.mean, self.seconds_of(dwell, &robust));
        }
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

    /// The seconds of a dwell as its robust mean weighs them: by the variance of all dwells, or by its own.
    fn seconds_of(&self, dwell: &DwellSummary, robust: &Robust) -> f64 {
        if !self.by_dwell {
            return dwell.seconds;
        }
        let own = f64::from(robust.line.residual_squares);
        let freedom = f64::from(dwell.degrees_of_freedom);
        dwell.seconds * self.variance * (freedom + SHARED_SECONDS) / (own + SHARED_SECONDS * self.variance)
    }

    /// The best slope of a dwell's rate, °/h/s.
    pub fn slope_per_s(&self, dwell: &DwellSummary) -> f64 {
        dwell.robust.filter(|_| self.robust).map_or(rate(dwell, self.eased), |robust| robust.line).slope_per_s
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
    /// `seen_arcsec2` is the variance of the angle at one moment as the rates show it, 0 where they do not. `None` where nothing is
    /// declared or seen.
    fn new<'a>(dwells: impl Iterator<Item = &'a DwellSummary>, seen_arcsec2: f64, gyro: &GyroSettings) -> Option<Self> {
        let declared = squared(gyro.angle_noise_arcsec);
        let angles = Pooled::new(dwells, |dwell| dwell.angle).filter(|angles| angles.walk() >= LEAST_WALK);
        let Some(angles) = angles else {
            let of_declared = Self { white: 0.0, of_second: declared, of_moment: declared };
            return (declared > 0.0).then_some(of_declared);
        };
        if seen_arcsec2.max(declared) <= 0.0 {
            return None;
        }
        let (about_line, of_steps) = (angles.variance(), angles.successive / angles.degrees_of_freedom);
        // Where the angles do not show a walk, the declared noise stands for it.
        let white =
            if angles.correlation_sigmas() > WALK_SIGMAS { (about_line - of_steps) / angles.walk() } else { 0.0 };
        let of_second = (of_steps - white / 3.0).max(0.0);
        Some(Self { white, of_second, of_moment: seen_arcsec2.max(declared).max(of_second) })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::Noise;
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

    /// Dwells of 30 s whose second `t_s` adds what `noise` says.
    fn dwells_of(mut noise: impl FnMut(f64) -> f64) -> Vec<DwellSummary> {
        let dwell = |position: u32| {
            let (sin, cos) = sin_cos_deg(90.0 * f64::from(position));
            let mut rows = DwellRows::default();
            for second in 0..30 {
                let t_s = f64::from(40 * position + second) + 0.5;
                let rate_deg_h = 10.0 * cos + noise(t_s);
                rows.push(Row { t_s, seconds: 1.0, cos, sin, rate_deg_h, moment_arcsec_s: 0.0, level: None }, 0.02);
            }
            rows.summary(0.02).unwrap()
        };
        (0..8).map(dwell).collect()
    }

    fn noise_of(dwells: &[DwellSummary]) -> Noise {
        let gyro = GyroSettings { arw_deg_per_sqrt_h: 0.02 / 60.0, ..GyroSettings::default() };
        Noise::new(dwells.iter(), &gyro, || None).unwrap()
    }

    /// 240 s of normal noise have an evidence of −10 ± 3 for heavy tails, and 3 is beyond four of these standard deviations: it is skewed, and of
    /// 1000 fixes three may take it.
    #[test]
    fn gaussian_noise_keeps_the_plain_mean() {
        let mut state = 3;
        let robust = (0..1000).filter(|_| noise_of(&dwells_of(|_| 0.1 * normal(&mut state))).robust).count();
        assert!(robust <= 3, "{robust}");
    }

    /// Student's t with two degrees of freedom: its variance has no limit, and what seconds beyond six scales leave of it is some 0.7 of that of the
    /// robust mean; three fixes of four take it, the others are as they were. That is 0.77 of the variance, 0.88 of the rms error; of 2400 dwells
    /// each is known to 3 %, and most of it is common to both.
    #[test]
    fn heavy_tails_take_the_robust_mean() {
        let mut state = 4;
        let (mut plain, mut robust, mut stated, mut taken) = (0.0, 0.0, 0.0, 0);
        for _ in 0..300 {
            let dwells = dwells_of(|_| {
                let squares: f64 = (0..2).map(|_| super::squared(normal(&mut state))).sum();
                0.1 * normal(&mut state) / libm::sqrt(squares / 2.0)
            });
            let noise = noise_of(&dwells);
            taken += u32::from(noise.robust);
            for dwell in &dwells {
                let (mean, weight) = noise.mean(dwell);
                plain += super::squared(dwell.rate.mean - 10.0 * dwell.cos);
                robust += super::squared(mean - 10.0 * dwell.cos);
                stated += noise.variance / weight;
            }
        }
        std::println!("{taken} of 300 robust; {:.3}, stated {:.3}", (robust / plain).sqrt(), (stated / robust).sqrt());
        assert!(taken > 225 && (robust / plain).sqrt() < 0.9, "{taken} {robust} {plain}");
        // The stated variance is that of the values' scatter: 4 % of statistics four times, and as much for its own bias.
        assert!((stated / robust - 1.0).abs() < 0.32, "{stated} {robust}");
    }

    /// Eight dwells of 30 s of white noise whose drive rings at 5 Hz by so many arcsec when each begins, with any phase, and forgets it in 5 s.
    fn dwells_that_ring(arcsec: f64, state: &mut u64) -> Vec<DwellSummary> {
        let dwell = |position: u32| {
            let (sin, cos) = sin_cos_deg(90.0 * f64::from(position));
            let phase = 10.0 * normal(state);
            let ringing =
                |t_s: f64| arcsec * libm::exp(-t_s / 5.0) * libm::cos(core::f64::consts::TAU * 5.0 * t_s + phase);
            let mut rows = DwellRows::default();
            for second in 0..30 {
                let turned = |i: u32| {
                    let [from, to] = [i, i + 1].map(|i| f64::from(second) + f64::from(i) / 40.0);
                    (ringing(to) - ringing(from), (f64::from(i) + 0.5) / 40.0 - 0.5)
                };
                let rung: f64 = (0..40).map(|i| turned(i).0).sum();
                let moment: f64 = (0..40).map(turned).map(|(turned, t_s)| turned * t_s).sum();
                let t_s = f64::from(40 * position + second) + 0.5;
                let rate_deg_h = 10.0 * cos + rung + 0.1 * normal(state);
                let moment_arcsec_s = moment + 0.1 / libm::sqrt(12.0) * normal(state);
                rows.push(Row { t_s, seconds: 1.0, cos, sin, rate_deg_h, moment_arcsec_s, level: None }, 0.1);
            }
            rows.summary(0.1).unwrap()
        };
        (0..8).map(dwell).collect()
    }

    /// Mean square of the errors of so many fixes' means over their stated variance, and how many fixes ease their dwells.
    fn rung(fixes: usize, arcsec: f64) -> (f64, usize) {
        let (mut state, mut ratio, mut eased) = (8, 0.0, 0);
        for _ in 0..fixes {
            let dwells = dwells_that_ring(arcsec, &mut state);
            let noise = noise_of(&dwells);
            eased += usize::from(noise.eased);
            for dwell in &dwells {
                let (mean, weight) = noise.mean(dwell);
                let of_mean = noise.variance / weight;
                ratio += super::squared(mean - 10.0 * dwell.cos) / of_mean / (8 * fixes) as f64;
            }
        }
        (ratio, eased)
    }

    /// Four standard deviations are passed by 3 in 10⁵ of fixes without a ringing: one of a thousand at most, but for one time in 2000. What rings by
    /// 1 arcsec puts 1/30 °/h · 1/√2 into a plain mean, 0.024 beside 0.1/√30 = 0.018: a mean square of 2.7 variances. Eased, it is 1 within
    /// four times √(2/2400) = 0.029, and what the ringing of the seconds adds to the stated variance.
    #[test]
    fn what_rings_at_the_beginning_is_seen_and_taken_out() {
        assert!(rung(1000, 0.0).1 <= 1, "{:?}", rung(1000, 0.0));
        let (ratio, eased) = rung(300, 1.0);
        assert!(eased == 300 && (0.8..1.12).contains(&ratio), "{ratio} {eased}");
    }

    /// Gusts let a tripod sway at 0.23 Hz, now by 0.1 arcsec and now by 2: the largest rates belong to the largest gusts, and the plain mean has what is
    /// left at its ends. At most a tenth of the fixes may take the robust mean, and it costs less than a tenth of the mean square error.
    #[test]
    fn sway_is_kept_whole() {
        let mut state = 5;
        let (mut taken, mut plain, mut chosen) = (0, 0.0, 0.0);
        for _ in 0..200 {
            let (mut gust, mut last) = (0.0, 0.0);
            let dwells = dwells_of(|t_s| {
                gust = 0.9 * gust + 0.45 * normal(&mut state);
                let angle = 0.5 * gust * gust * (core::f64::consts::TAU * 0.23 * t_s).sin();
                let rate = angle - last;
                last = angle;
                rate + 0.02 * normal(&mut state)
            });
            let noise = noise_of(&dwells);
            taken += u32::from(noise.robust);
            for dwell in &dwells {
                plain += super::squared(dwell.rate.mean - 10.0 * dwell.cos);
                chosen += super::squared(noise.mean(dwell).0 - 10.0 * dwell.cos);
            }
        }
        std::println!("{taken} of 200 robust; mean square {:.3} of the plain mean's", chosen / plain);
        assert!(taken <= 20 && chosen < 1.1 * plain, "{taken} {chosen} {plain}");
    }

    /// The later four dwells have four times the noise: a weight of a sixteenth in the optimum; beside eight shared seconds of the mean variance 8.5
    /// the 30 s of variance 1 and of 16 have (28 + 8 · 8.5) and (28 · 16 + 8 · 8.5): 5.4 times as much.
    #[test]
    fn a_noisy_dwell_weighs_less_where_tails_are_heavy() {
        let mut state = 6;
        let mut both = (0.0, 0.0);
        for _ in 0..20 {
            let dwells = dwells_of(|t_s| {
                let squares: f64 = (0..2).map(|_| super::squared(normal(&mut state))).sum();
                let scale = if t_s < 160.0 { 0.1 } else { 0.4 };
                scale * normal(&mut state) / libm::sqrt(squares / 2.0)
            });
            let noise = noise_of(&dwells);
            let weight = |i: usize| noise.mean(&dwells[i]).1;
            if noise.robust && noise.by_dwell {
                both = (both.0 + weight(0) + weight(1), both.1 + weight(6) + weight(7));
            }
        }
        assert!(both.0 > 3.0 * both.1 && both.1 > 0.0, "{both:?}");
    }

    /// 1 arcsec of the angle, of which four readings make a second, is declared: whatever one dwell of 30 s shows, its mean has no more than
    /// 2/900 (°/h)², where the scatter of its seconds would give it 2/30. Of 200 dwells the mean square of an error in sigmas is known to 10 %;
    /// sigma's own doubt is that of one dwell, and rather too large.
    #[test]
    fn declared_noise_of_the_angle_is_reckoned_with_in_every_fix() {
        let mut state = 7;
        let gyro = GyroSettings { arw_deg_per_sqrt_h: 0.02 / 60.0, angle_noise_arcsec: 1.0, ..GyroSettings::default() };
        assert!((gyro.noise_deg_h() - libm::sqrt(2.0 + 0.02 * 0.02)).abs() < 1e-12);
        let mut ratio = 0.0;
        for _ in 0..200 {
            let mut last = normal(&mut state);
            let mut rows = DwellRows::default();
            for second in 0..30 {
                let (mut rate_deg_h, mut moment_arcsec_s) = (0.0, 0.0);
                for quarter in 0..4 {
                    let reading = normal(&mut state);
                    rate_deg_h += reading - last;
                    moment_arcsec_s += (reading - last) * (0.25 * f64::from(quarter) - 0.375);
                    last = reading;
                }
                let t_s = f64::from(second) + 0.5;
                let row = Row { t_s, seconds: 1.0, cos: 0.0, sin: 1.0, rate_deg_h, moment_arcsec_s, level: None };
                rows.push(row, gyro.noise_deg_h());
            }
            let dwell = rows.summary(gyro.noise_deg_h()).unwrap();
            let noise = Noise::new([dwell].iter(), &gyro, || None).unwrap();
            let (mean, weight) = noise.mean(&dwell);
            let variance = noise.variance / weight;
            assert!(variance < 1.1 * 2.0 / 900.0, "{variance}");
            ratio += mean * mean / variance / 200.0;
        }
        assert!((0.25..1.4).contains(&ratio), "{ratio}");
    }
}

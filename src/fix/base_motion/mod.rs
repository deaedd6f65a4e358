//! Turning of the base during a fix, from the level accelerometers.
//!
//! A base that tilts adds cos θ · dr/dt − sin θ · dp/dt to what the indexed gyro reads: a first harmonic, just like the
//! azimuth itself, so no closure shows it. The accelerometers feel the same tilt. Two ways to use them:
//!
//! - *path*: the tilt over the whole fix as a polynomial in time, of one degree more than the data ask for (at most
//!   the fourth); the rate at each dwell is its mean derivative. Precise, for a base that creeps smoothly.
//! - *slopes*: the tilt's slope inside each dwell. For a base that jumps between dwells, where a path has no meaning.
//!
//! Nothing is corrected unless the readings changed significantly, because the correction carries the accelerometers' noise. Where they did,
//! it may have been the accelerometers that changed and not the base: the gyro, which feels the base only, and what is declared of the
//! accelerometers' drift decide how much of either it was (`super::motion`).

mod jump_search;
mod jumps;
pub mod levels;
mod tilt;

use heapless::Vec;
use jumps::Jumps;
use levels::{FUNCTIONS, Law, Levels, Path, Prior, SIGNIFICANT};
use tilt::tilt_arcsec;

use super::dwell::DwellSummary;
use super::statistics::chi_square_z_score;
use crate::sensing::level::LevelDrift;

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

impl BaseMotion {
    pub fn is_moving(&self) -> bool {
        matches!(self, Self::Moving(_))
    }

    /// The path of the base that is taken out.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Moving(Method::Path(path)) => Some(path),
            _ => None,
        }
    }

    /// What the base's turning adds to the gyro's rate at a dwell, °/h: cos θ · dr/dt − sin θ · dp/dt.
    pub fn rate_deg_h(&self, dwell: &DwellSummary) -> f64 {
        let [pitch_deg_h, roll_deg_h] = match self {
            Self::Unknown | Self::Still => return 0.0,
            Self::Moving(Method::Slopes { .. }) => slopes_deg_h(dwell),
            Self::Moving(Method::Path(path)) => {
                let rates = path.rates(dwell);
                path.coefficients().map(|coefficients| rates.dot(&coefficients))
            }
        };
        dwell.cos * roll_deg_h - dwell.sin * pitch_deg_h
    }
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

/// Tilt rate (pitch, roll) inside one dwell, arcsec/s, that is °/h.
pub fn slopes_deg_h(dwell: &DwellSummary) -> [f64; 2] {
    tilt_arcsec(dwell).map_or([0.0; 2], |axes| axes.map(|line| line.slope_per_s))
}

/// Whether a path of this degree leaves more than noise of the levels.
fn is_improbable(dwells: &[DwellSummary], levels: &Levels, degree: usize, jumps: &Jumps) -> bool {
    let degrees_of_freedom = jumps.readings(dwells) - 2.0 * ((degree + 1 + jumps.count()) as f64);
    let chi_square = levels.chi_square(degree);
    degrees_of_freedom > 0.0 && chi_square_z_score(chi_square, degrees_of_freedom) > IMPROBABLE_SIGMAS
}

/// Whether the levels of the last dwell are others than those of the first, by more than their noise: two dwells tell that, and no path.
pub fn levels_changed(dwells: &[DwellSummary]) -> bool {
    let chi_square = || {
        let (first, last) = (dwells.first()?, dwells.last()?);
        let of_means = 1.0 / first.seconds + 1.0 / last.seconds;
        let axes =
            tilt_arcsec(first)?.into_iter().zip(tilt_arcsec(last)?).zip(Jumps::default().variance_arcsec2(dwells)?);
        let squares =
            axes.map(|((before, after), variance)| (after.mean - before.mean) * (after.mean - before.mean) / variance);
        Some(squares.sum::<f64>() / of_means)
    };
    chi_square().is_some_and(|chi_square| chi_square > SIGNIFICANT)
}

/// The greater range of both axes' levels in a fix, arcsec: of the ends of the line through the readings of each dwell. `None` where one has none.
pub fn range_arcsec(dwells: &[DwellSummary]) -> Option<f64> {
    let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for dwell in dwells {
        let half_s = 0.5 * (dwell.end_s - dwell.start_s);
        for ([low, high], line) in ranges.iter_mut().zip(tilt_arcsec(dwell)?) {
            let end_arcsec = (line.slope_per_s * half_s).abs();
            (*low, *high) = (low.min(line.mean - end_arcsec), high.max(line.mean + end_arcsec));
        }
    }
    ranges.map(|[low, high]| high - low).into_iter().reduce(f64::max)
}

/// Looks for motion in the dwells of a fix, as of accelerometers that do not drift. What is taken out by the second is gone.
pub fn detect(dwells: &[DwellSummary]) -> BaseMotion {
    if dwells.iter().any(|dwell| dwell.base_taken_out) {
        return BaseMotion::Still;
    }
    let none = Jumps::default();
    let Some(variance) = none.variance_arcsec2(dwells) else { return BaseMotion::Unknown };
    let Some(levels) = Levels::new(dwells, Law::Powers, variance, &Prior::FREE, &none) else {
        return BaseMotion::Unknown;
    };
    let degree = (1..FUNCTIONS).rev().find(|&degree| levels.explained(degree) > SIGNIFICANT).unwrap_or(0);
    if is_improbable(dwells, &levels, degree, &none) {
        return BaseMotion::Moving(Method::Slopes { variance });
    }
    if degree == 0 {
        return BaseMotion::Still;
    }
    // One degree more than the data insist on: what is just not significant would else bias the rates.
    BaseMotion::Moving(Method::Path(levels.path((degree + 1).min(FUNCTIONS - 1))))
}

/// Laws of a path that are tried beside drifting accelerometers: time constants a factor of ∛2 apart, from a tenth of the fix, when a creep is over
/// before the second dwell ends, to two fixes, when it is nearly a parabola. With √2 between them what the nearest one leaves of a creep of 60 arcsec is
/// taken for drift, and two fixes in a hundred more are outside of 95 % (`fix::motion`).
const LAWS: [Law; 15] = [
    Law::Powers,
    Law::Creep(0.2),
    Law::Creep(0.252),
    Law::Creep(0.317),
    Law::Creep(0.4),
    Law::Creep(0.504),
    Law::Creep(0.635),
    Law::Creep(0.8),
    Law::Creep(1.008),
    Law::Creep(1.27),
    Law::Creep(1.6),
    Law::Creep(2.016),
    Law::Creep(2.54),
    Law::Creep(3.2),
    Law::Creep(4.032),
];
/// One sigma of what a base may have moved, by the range of the levels: a drift may hide a part of it, and a creep of a fix's time constant is seen to 0.6.
const PATH_BY_RANGE: f64 = 1.5;
/// Most paths that are held against the gyro's rates.
const MOST_PATHS: usize = 8;
/// A path whose likelihood is less than the best one's by this factor, as a logarithm, is left out: one in 3000.
const NEGLIGIBLE: f64 = 8.0;

/// A path of the base, where the accelerometers may have drifted by what is declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supposed {
    pub path: Path,
    /// By how much the logarithm of the likelihood of the levels alone is greater than that of a base that stands.
    pub log_likelihood: f64,
}

/// Paths that the base may have moved along, of any size, while the accelerometers drifted: the likelier ones by the levels, the likeliest first. The base may
/// have jumped meanwhile where the gyro measured shocks, or where no path fits without. Empty where none fits with jumps, either.
pub fn beside_drift(dwells: &[DwellSummary], drift: LevelDrift) -> Vec<Supposed, MOST_PATHS> {
    let paths_with = |jumps: &Jumps| paths(dwells, drift, jumps);
    let jumps = jump_search::likeliest(dwells);
    let likeliest = paths_with(&jumps);
    if !likeliest.is_empty() || jumps.count() > 0 {
        return likeliest;
    }
    jump_search::one_at_least(dwells).map_or(likeliest, |(_, jumps)| paths_with(&jumps))
}

/// The same with these jumps.
fn paths(dwells: &[DwellSummary], drift: LevelDrift, jumps: &Jumps) -> Vec<Supposed, MOST_PATHS> {
    let mut paths = Vec::new();
    let range_arcsec = jumps.range_arcsec(dwells).filter(|&range_arcsec| range_arcsec > 0.0);
    let Some((variance, range_arcsec)) = jumps.variance_arcsec2(dwells).zip(range_arcsec) else { return paths };
    let prior = Prior { drift, path_arcsec: PATH_BY_RANGE * range_arcsec };
    // As many as there are laws and degrees share what is supposed of a base that moves.
    let share = -libm::log(LAWS.iter().map(|law| law.most()).sum::<usize>() as f64);
    let mut fits = false;
    for law in LAWS {
        let Some(levels) = Levels::new(dwells, law, variance, &prior, jumps) else { continue };
        fits |= !is_improbable(dwells, &levels, law.most(), jumps);
        for degree in 1..=law.most() {
            let log_likelihood = levels.log_likelihood_of(degree) + share;
            let rank = paths.iter().take_while(|path: &&Supposed| path.log_likelihood > log_likelihood).count();
            if rank == MOST_PATHS {
                continue;
            }
            paths.truncate(MOST_PATHS - 1);
            // There is room for one now.
            let _ = paths.insert(rank, Supposed { path: levels.path(degree), log_likelihood });
        }
    }
    let best = paths.first().map_or(0.0, |path| path.log_likelihood);
    paths.retain(|path| fits && path.log_likelihood > best - NEGLIGIBLE);
    paths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::dwell::{DwellRows, Row};
    use crate::sensing::level::LevelMoments;
    use crate::units::ARCSEC_PER_RAD;

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
        assert!(!levels_changed(&dwells(|_| 0.0)) && levels_changed(&dwells(|t_s| 0.02 * t_s)));
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

    /// A base that creeps by 0.1 arcsec/s is tilted by shocks of 100 arcsec: in the fifth dwell, which lasts from 152 to 182 s, between the fifth and the sixth, and
    /// both. Its rate is found; by a smooth path it would not be.
    #[test]
    fn a_creep_goes_on_after_shocks() {
        let after = |at_s: f64, t_s: f64| if t_s > at_s { 100.0 } else { 0.0 };
        for (first_s, second_s) in [(165.0, f64::INFINITY), (185.0, f64::INFINITY), (165.0, 225.0)] {
            let dwells = dwells(|t_s| 0.1 * t_s + after(first_s, t_s) - after(second_s, t_s));
            assert!(matches!(detect(&dwells), BaseMotion::Moving(Method::Slopes { .. })));
            let paths = beside_drift(&dwells, LevelDrift::default());
            let path = paths.first().expect("a path with jumps").path;
            for dwell in &dwells {
                let rate_deg_h = path.rates(dwell).dot(&path.coefficients()[0]);
                assert!((rate_deg_h - 0.1).abs() < 0.02, "{first_s} {second_s}: {rate_deg_h}");
            }
        }
    }

    #[test]
    fn without_accelerometers_nothing_is_said() {
        let mut silent = dwells(|_| 0.0);
        silent[3].level = None;
        assert_eq!(detect(&silent), BaseMotion::Unknown);
        assert_eq!(detect(&[]), BaseMotion::Unknown);
    }
}

//! Times at which the base was knocked, or levelled again: its tilt is another one afterwards.
//!
//! While it jumped the gyro's seconds are no measurement, and are left out as outliers or lie between two dwells; before and after the base goes on as it
//! did. So each jump is a further unknown of the levels, which no rate knows of, and a dwell in which the base jumped says nothing of its levels.

use heapless::Vec;

use super::SIGNIFICANT;
use super::levels::{FUNCTIONS, Law, Levels, Prior, tilt_arcsec};
use crate::bounded::bounded;
use crate::fix::doubt::MOST;
use crate::fix::dwell::DwellSummary;
use crate::sensing::level::LevelDrift;

/// Most jumps of a fix.
pub const MOST_JUMPS: usize = 3;
/// What a jump must explain in a dwell in which the gyro felt a knock, variances: twice what chance explains of both axes by its size (Akaike, IEEE Transactions on
/// Automatic Control 19, 1974, p. 716). Elsewhere it must be as significant as a path.
const WHERE_KNOCKED: f64 = 4.0;
/// Their times, seconds.
#[derive(Clone, Debug, Default)]
pub struct Jumps {
    at_s: Vec<f64, MOST_JUMPS>,
}

impl Jumps {
    /// None, where the gyro felt no knock, or as many as leave the least: each where a polynomial of few degrees leaves the least beside those before it.
    pub fn likeliest(dwells: &[DwellSummary]) -> Self {
        let none = Self::default();
        if dwells.iter().all(|dwell| dwell.outliers == 0) {
            return none;
        }
        let without = usual_variance_arcsec2(dwells).and_then(|variance| none.left(dwells, variance));
        match Self::one_at_least(dwells).zip(without) {
            Some(((left, jumps), without)) if left < without => jumps,
            _ => none,
        }
    }

    /// The same, but one at least, and what it leaves. `None` where the dwells do not determine any.
    pub fn one_at_least(dwells: &[DwellSummary]) -> Option<(f64, Self)> {
        let variance = usual_variance_arcsec2(dwells)?;
        let (mut jumps, mut best): (Self, Option<(f64, Self)>) = (Self::default(), None);
        while let Some((left, with)) = jumps.with_next(dwells, variance) {
            if best.as_ref().is_none_or(|best| left < best.0) {
                best = Some((left, with.clone()));
            }
            jumps = with;
        }
        best
    }

    /// With a further one, in a dwell or between two, and what is left then.
    fn with_next(&self, dwells: &[DwellSummary], variance: [f64; 2]) -> Option<(f64, Self)> {
        let with = |at_s: f64| {
            let mut with = self.clone();
            with.at_s.push(at_s).ok()?;
            Some((with.left(dwells, variance)?, with))
        };
        let between = dwells.iter().skip(1).map(|dwell| dwell.start_s);
        let within = dwells.iter().map(|dwell| 0.5 * (dwell.start_s + dwell.end_s));
        between.chain(within).filter_map(with).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The sum of squares that these and a polynomial leave, in variances, less what is expected of the readings that count, and what every power of the
    /// polynomial and every jump must explain to be taken for one.
    fn left(&self, dwells: &[DwellSummary], variance: [f64; 2]) -> Option<f64> {
        let free = Prior { drift: LevelDrift::default(), path_arcsec: f64::INFINITY };
        let levels = Levels::new(dwells, Law::Powers, variance, &free, self)?;
        let of_jumps = self.at_s.iter().map(|&at_s| asked_of(dwells, at_s)).sum::<f64>();
        let with_path = |degree: usize| levels.chi_square(degree) + SIGNIFICANT * degree as f64;
        Some((0..FUNCTIONS).map(with_path).min_by(f64::total_cmp)? + of_jumps - self.readings(dwells))
    }

    /// How many readings of both axes, means and slopes, the base did not jump in.
    pub fn readings(&self, dwells: &[DwellSummary]) -> f64 {
        let spared = || dwells.iter().filter(|dwell| self.spare(dwell));
        2.0 * (spared().count() + spared().filter(|dwell| dwell.time_spread > 0.0).count()) as f64
    }

    pub fn count(&self) -> usize {
        self.at_s.len()
    }

    /// Whether the base did not jump within a dwell.
    pub fn spare(&self, dwell: &DwellSummary) -> bool {
        !self.at_s.iter().any(|&at_s| dwell.start_s < at_s && at_s < dwell.end_s)
    }

    /// For every jump, 1 after it.
    pub fn before(&self, dwell: &DwellSummary) -> [f64; MOST_JUMPS] {
        core::array::from_fn(|i| f64::from(self.at_s.get(i).is_some_and(|&at_s| at_s <= dwell.start_s)))
    }

    /// Variance of a one-second tilt about a line in each dwell in which the base did not jump, arcsec², pitch and roll; `None` where too little is measured.
    pub fn variance_arcsec2(&self, dwells: &[DwellSummary]) -> Option<[f64; 2]> {
        let mut degrees_of_freedom = 0.0;
        let mut scatter = [0.0; 2];
        for dwell in dwells.iter().filter(|dwell| self.spare(dwell)) {
            degrees_of_freedom += f64::from(dwell.degrees_of_freedom);
            for (sum, line) in scatter.iter_mut().zip(tilt_arcsec(dwell)?) {
                *sum += f64::from(line.residual_squares);
            }
        }
        // A reading that never changes is no measurement.
        let is_measured = degrees_of_freedom >= 10.0 && scatter.iter().all(|&sum| sum > 0.0);
        is_measured.then(|| scatter.map(|sum| sum / degrees_of_freedom))
    }

    /// The greater range of both axes' means between two jumps, arcsec.
    pub fn range_arcsec(&self, dwells: &[DwellSummary]) -> Option<f64> {
        let mut range: f64 = 0.0;
        for axis in 0..2 {
            let mut since = None;
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for dwell in dwells.iter().filter(|dwell| self.spare(dwell)) {
                let mean = tilt_arcsec(dwell)?.get(axis)?.mean;
                let before = Some(self.before(dwell));
                if since != before {
                    (since, low, high) = (before, f64::INFINITY, f64::NEG_INFINITY);
                }
                (low, high) = (low.min(mean), high.max(mean));
                range = range.max(high - low);
            }
        }
        Some(range)
    }
}

/// What a jump at this time must explain.
fn asked_of(dwells: &[DwellSummary], at_s: f64) -> f64 {
    let felt = |dwell: &DwellSummary| dwell.outliers > 0 && dwell.start_s < at_s && at_s < dwell.end_s;
    if dwells.iter().any(felt) { WHERE_KNOCKED } else { SIGNIFICANT }
}

/// Variance of a one-second tilt about a line in a usual dwell, the median, arcsec², pitch and roll: a jump in a few of them is not in it.
fn usual_variance_arcsec2(dwells: &[DwellSummary]) -> Option<[f64; 2]> {
    let mut variances = [0.0; 2];
    for (axis, variance) in variances.iter_mut().enumerate() {
        let of_dwell = |dwell: &DwellSummary| {
            let line = *tilt_arcsec(dwell)?.get(axis)?;
            Some(f64::from(line.residual_squares) / f64::from(dwell.degrees_of_freedom.max(1)))
        };
        let mut all: Vec<f64, MOST> = bounded(dwells.iter().filter_map(of_dwell));
        all.sort_unstable_by(f64::total_cmp);
        *variance = *all.get(all.len() / 2)?;
    }
    variances.iter().all(|&variance| variance > 0.0).then_some(variances)
}

//! Times at which a shock moved the base, or it was levelled again: its tilt is another one afterwards.
//!
//! While it jumped the gyro's seconds are no measurement, and are left out as outliers or lie between two dwells; before and after the base goes on as it
//! did. So each jump is a further unknown of the levels, which no rate knows of, and a dwell in which the base jumped says nothing of its levels.

use heapless::Vec;

use super::tilt::tilt_arcsec;
use crate::fix::dwell::DwellSummary;

/// Most jumps of a fix.
pub const MOST_JUMPS: usize = 3;

/// Their times, seconds.
#[derive(Clone, Debug, Default)]
pub struct Jumps {
    at_s: Vec<f64, MOST_JUMPS>,
}

impl Jumps {
    /// With a further one; `None` where there is no room for it.
    pub fn with(&self, at_s: f64) -> Option<Self> {
        let mut with = self.clone();
        with.at_s.push(at_s).ok().map(|()| with)
    }

    pub fn at_s(&self) -> &[f64] {
        &self.at_s
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

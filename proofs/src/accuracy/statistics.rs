//! What many trials say together, and how far to trust it.

use serde::Serialize;

use super::Trial;

/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.959_964;

/// Summary of the trials of one row of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    pub trials: usize,
    /// Trials in which the fix was refused; they are in none of the other numbers.
    pub refused: usize,
    /// Root mean square of the azimuth error, degrees.
    pub rms_deg: f64,
    /// Mean azimuth error, degrees.
    pub mean_deg: f64,
    /// Root mean square of the bound, degrees.
    pub bound_deg: f64,
    /// Root mean square of error / bound.
    pub ratio: f64,
    /// Half width of the 95 % confidence interval of the ratio: an rms of n errors has the relative standard deviation
    /// 1/√(2n).
    pub ratio_confidence_95: f64,
    /// Share of trials whose ±1.96 sigma interval holds the truth.
    pub coverage: f64,
    /// Half width of its 95 % confidence interval (binomial).
    pub coverage_confidence_95: f64,
    /// Share of trials that carried a flag.
    pub flagged: f64,
}

impl Statistics {
    /// Of the trials that gave an azimuth; `None` if none did.
    pub fn of(trials: &[Trial], refused: usize) -> Option<Self> {
        let count = trials.len();
        if count == 0 {
            return None;
        }
        let mean = |value: &dyn Fn(&Trial) -> f64| trials.iter().map(value).sum::<f64>() / count as f64;
        let share = |is: &dyn Fn(&Trial) -> bool| mean(&|trial| f64::from(u8::from(is(trial))));
        let ratio = mean(&|trial| (trial.error_deg / trial.bound_deg).powi(2)).sqrt();
        let coverage = share(&|trial| trial.error_deg.abs() <= Z_95 * trial.sigma_deg);
        Some(Self {
            trials: count,
            refused,
            rms_deg: mean(&|trial| trial.error_deg.powi(2)).sqrt(),
            mean_deg: mean(&|trial| trial.error_deg),
            bound_deg: mean(&|trial| trial.bound_deg.powi(2)).sqrt(),
            ratio,
            ratio_confidence_95: ratio * confidence_95(count),
            coverage,
            coverage_confidence_95: Z_95 * (coverage * (1.0 - coverage) / count as f64).sqrt(),
            flagged: share(&|trial| trial.flagged),
        })
    }
}

/// Relative half width of the 95 % confidence interval of an rms from this many trials.
pub fn confidence_95(trials: usize) -> f64 {
    Z_95 / (2.0 * trials as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_by_hand() {
        let trial = |error_deg, sigma_deg| Trial { error_deg, sigma_deg, bound_deg: 2.0, flagged: error_deg > 3.0 };
        let trials = [trial(3.0, 1.0), trial(-3.0, 2.0), trial(1.0, 1.0), trial(5.0, 3.0)];
        let statistics = Statistics::of(&trials, 1).unwrap();
        // (9 + 9 + 1 + 25) / 4 = 11.
        assert_eq!(statistics.rms_deg, 11f64.sqrt());
        assert_eq!(statistics.ratio, (11.0f64 / 4.0).sqrt());
        assert_eq!(statistics.mean_deg, 1.5);
        assert_eq!((statistics.coverage, statistics.flagged, statistics.refused), (0.75, 0.25, 1));
        // 1.96 / sqrt 8 = 0.693.
        assert!((statistics.ratio_confidence_95 / statistics.ratio - 0.69296).abs() < 1e-4);
        assert_eq!(Statistics::of(&[], 7), None);
    }
}

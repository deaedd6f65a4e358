//! Many verdicts of one family together.

use serde::Serialize;

use super::verdict::{Attribution, Errors, Verdict};
use crate::statistics::{self, probability_interval, ratio_interval};

/// Student's t above which a campaign counts as made worse: one in a hundred, one-sided, for the 3 to 14 check runs that
/// campaigns have it is between 2.6 and 7; the strictest that is still easy to meet is taken.
const WORSE_T: f64 = 3.0;
/// … and the rms must have grown by more than this, so that numbers that hardly differ do not count.
const WORSE_BY: f64 = 1.1;

/// A 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// One row of the table. Shares are of the campaigns that were diagnosed, 0 to 1.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    pub campaigns: usize,
    pub refused: usize,
    /// Check runs with an azimuth.
    pub runs: usize,
    pub without_azimuth: usize,
    /// Root mean square azimuth errors, degrees.
    pub before_deg: f64,
    pub after_deg: f64,
    pub oracle_deg: f64,
    pub without_deg: f64,
    /// After over oracle, every error in units of its campaign's noise; bootstrap over the campaigns.
    pub ratio: Interval,
    /// After over before, the same way.
    pub gain: Interval,
    /// Campaigns in which an oracle sees the effect plainly.
    pub visible: usize,
    /// Of those: said to be ambiguous, the right one among them.
    pub ambiguous: f64,
    /// Visible ones that are not ambiguous.
    pub telling: usize,
    /// Of those: named rightly, and the 95 % interval of the probability of it.
    pub right: f64,
    pub right_interval: [f64; 2],
    /// Campaigns in which something was named that is not there.
    pub false_discovery: f64,
    pub unexplained: f64,
    /// Something was named and nothing said to be unexplained: for a foreign effect, misnamed.
    pub misnamed: f64,
    pub made_worse: f64,
    /// Check runs whose azimuth after ± 1.96 of its sigma holds the truth.
    pub covered: usize,
}

/// Sums up the verdicts of a family; `None` without any diagnosis.
pub fn summarize(verdicts: &[&Verdict]) -> Option<Summary> {
    let diagnosed: Vec<&Verdict> = verdicts.iter().copied().filter(|verdict| verdict.refusal.is_none()).collect();
    if diagnosed.is_empty() {
        return None;
    }
    let share = |of: &[&Verdict], is: &dyn Fn(&Verdict) -> bool| {
        of.iter().filter(|verdict| is(verdict)).count() as f64 / of.len().max(1) as f64
    };
    let visible: Vec<&Verdict> = diagnosed.iter().copied().filter(|verdict| verdict.visible).collect();
    let ambiguous = |verdict: &Verdict| verdict.attribution == Attribution::Ambiguous;
    let telling: Vec<&Verdict> = visible.iter().copied().filter(|verdict| !ambiguous(verdict)).collect();
    let right = telling.iter().filter(|verdict| verdict.attribution == Attribution::Right).count();
    let runs: usize = diagnosed.iter().map(|verdict| verdict.errors.len()).sum();
    let rms_deg = |of: &dyn Fn(&Errors) -> f64| {
        let sum = diagnosed
            .iter()
            .flat_map(|verdict| verdict.errors.iter().map(|errors| (of(errors) * verdict.noise_deg).powi(2)));
        (sum.sum::<f64>() / runs.max(1) as f64).sqrt()
    };
    Some(Summary {
        campaigns: diagnosed.len(),
        refused: verdicts.len() - diagnosed.len(),
        runs,
        without_azimuth: diagnosed.iter().map(|verdict| verdict.without_azimuth).sum(),
        before_deg: rms_deg(&|errors| errors.before),
        after_deg: rms_deg(&|errors| errors.after),
        oracle_deg: rms_deg(&|errors| errors.oracle),
        without_deg: rms_deg(&|errors| errors.without),
        ratio: ratio(&diagnosed, |errors| errors.after, |errors| errors.oracle),
        gain: ratio(&diagnosed, |errors| errors.after, |errors| errors.before),
        visible: visible.len(),
        ambiguous: share(&visible, &ambiguous),
        telling: telling.len(),
        right: right as f64 / telling.len().max(1) as f64,
        right_interval: probability_interval(right, telling.len()),
        false_discovery: share(&diagnosed, &|verdict| verdict.false_effects > 0),
        unexplained: share(&diagnosed, &|verdict| verdict.unexplained),
        misnamed: share(&diagnosed, &|verdict| verdict.false_effects > 0 && !verdict.unexplained),
        made_worse: share(&diagnosed, &|verdict| made_worse(&verdict.errors)),
        covered: diagnosed.iter().flat_map(|verdict| &verdict.errors).filter(|errors| errors.is_covered()).count(),
    })
}

/// Ratio of two rms over all check runs, with its bootstrap interval over the campaigns.
fn ratio(verdicts: &[&Verdict], over: fn(&Errors) -> f64, under: fn(&Errors) -> f64) -> Interval {
    let sums: Vec<[f64; 2]> = verdicts
        .iter()
        .map(|verdict| [over, under].map(|of| verdict.errors.iter().map(|errors| of(errors).powi(2)).sum()))
        .collect();
    let [low, high] = ratio_interval(&sums).map(f64::sqrt);
    Interval { value: statistics::ratio(&sums).sqrt(), low, high }
}

/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.959_964;

impl Errors {
    /// Whether the 95 % interval holds the truth.
    pub fn is_covered(&self) -> bool {
        self.after.abs() <= Z_95 * self.sigma_after
    }
}

/// Whether the squared errors grew beyond chance: paired t of their differences.
fn made_worse(errors: &[Errors]) -> bool {
    let count = errors.len() as f64;
    let square = |of: fn(&Errors) -> f64| errors.iter().map(|errors| of(errors).powi(2)).sum::<f64>();
    if errors.len() < 3 || square(|errors| errors.after) <= WORSE_BY.powi(2) * square(|errors| errors.before) {
        return false;
    }
    let growth = |errors: &Errors| errors.after.powi(2) - errors.before.powi(2);
    let mean = errors.iter().map(growth).sum::<f64>() / count;
    let variance = errors.iter().map(|errors| (growth(errors) - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean > WORSE_T * (variance / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(before: f64, after: f64) -> Errors {
        Errors { before, after, oracle: 1.0, without: 1.0, sigma_after: 1.0 }
    }

    #[test]
    fn worse_beyond_chance_by_hand() {
        // Growth 3, 3.2, 2.8, 3: mean 3, standard deviation 0.16, t = 36.
        let grown = [2.0, 4.2_f64.sqrt(), 3.8_f64.sqrt(), 2.0].map(|after| errors(1.0, after));
        assert!(made_worse(&grown));
        // Growth 3, −3, 3, −3: none.
        assert!(!made_worse(&[errors(1.0, 2.0), errors(2.0, 1.0), errors(1.0, 2.0), errors(2.0, 1.0)]));
        assert!(!made_worse(&[errors(1.0, 1.01); 8]));
    }

    #[test]
    fn a_ratio_of_equal_campaigns_has_no_width() {
        let verdict = Verdict {
            family: "drift",
            number: 0,
            hidden: String::new(),
            found: Vec::new(),
            attribution: Attribution::Right,
            visible: true,
            evidence: 100.0,
            false_effects: 0,
            unexplained: false,
            errors: vec![errors(3.0, 1.5); 4],
            noise_deg: 0.1,
            without_azimuth: 0,
            refusal: None,
        };
        let summary = summarize(&[&verdict, &verdict]).unwrap();
        assert_eq!(summary.ratio, Interval { value: 1.5, low: 1.5, high: 1.5 });
        assert_eq!(summary.gain.value, 0.5);
        assert!((summary.before_deg - 0.3).abs() < 1e-12);
        assert_eq!((summary.right, summary.visible, summary.runs), (1.0, 2, 8));
        // Of two in two the lower end is √0.025.
        let [low, high] = summary.right_interval;
        assert!((low - 0.025f64.sqrt()).abs() < 1e-4 && high == 1.0);
        // 1.5 is within 1.96.
        assert_eq!(summary.covered, 8);
        assert!(summarize(&[]).is_none());
    }
}

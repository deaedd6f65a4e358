//! What the test says of a log, and what follows from it.

use north_finder::effects::ErrorModel;

use super::watch::BASELINE;
use super::{Lacking, Log, Moved, Needed, OtherPlace, Signal, Watch};
use crate::count::counted;

/// A log that was watched.
pub struct History<'a> {
    pub log: &'a Log,
    pub signals: &'a [Signal],
    /// What only some fixes have.
    pub left_out: &'a [Lacking],
    /// Fixes before those of the log, made with other error models.
    pub other_models: usize,
    pub verdict: Watch,
    /// Of every change: the coefficient of the model that moved, where the model is known; another place that would explain it; the runs that show it
    /// best.
    pub moved: Vec<Option<Moved>>,
    pub other_place: Vec<Option<OtherPlace>>,
    pub needed: Vec<Needed>,
}

impl<'a> History<'a> {
    /// Of `log`, the part of a whole log that was made with the last error model, after `other_models` fixes.
    pub fn new(
        (log, other_models): (&'a Log, usize),
        (signals, left_out): (&'a [Signal], &'a [Lacking]),
        verdict: Watch,
        model: Option<&ErrorModel>,
    ) -> Self {
        let range_c = log.temperatures_c().and_then(|all_c| {
            let after = all_c.get(BASELINE..).filter(|after| !after.is_empty())?;
            Some(after.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &at| [low.min(at), high.max(at)]))
        });
        let changes = &verdict.changes;
        Self {
            moved: changes.iter().map(|change| Moved::new(change, log, model?)).collect(),
            other_place: changes.iter().map(|change| OtherPlace::new(change, log)).collect(),
            needed: changes.iter().map(|change| Needed::new(change, range_c)).collect(),
            log,
            other_models,
            signals,
            left_out,
            verdict,
        }
    }

    /// What of the whole log is not watched, in sentences.
    pub fn not_watched(&self) -> Vec<String> {
        let fixes = self.log.fixes.len();
        let models = (self.other_models > 0).then(|| {
            let other = counted(self.other_models, "fix");
            format!("{other} before these, made with another error model, or with other ones: the watch begins anew with a model")
        });
        let signals = self.left_out.iter().map(|Lacking { signal, lacking, first_fix }| {
            format!(
                "{} is not watched: {lacking} of {fixes} fixes lack it, the first of them fix {first_fix}",
                signal.name()
            )
        });
        let all_c: Vec<f64> = self.log.fixes.iter().filter_map(|fix| fix.temp_c).collect();
        let temperature = (!all_c.is_empty() && all_c.len() < fixes).then(|| {
            format!("the gyro's temperature is not looked at: {} of {fixes} fixes lack temp_c", fixes - all_c.len())
        });
        models.into_iter().chain(signals).chain(temperature).collect()
    }
}

//! What the test says of a log, and what follows from it.

use north_finder::effects::ErrorModel;

use super::watch::BASELINE;
use super::{Log, Moved, Needed, OtherPlace, Signal, Watch};

/// A log that was watched.
pub struct History<'a> {
    pub log: &'a Log,
    pub signals: &'a [Signal],
    pub verdict: Watch,
    /// Of every change: the coefficient of the model that moved, where the model is known; another place that would explain it; the runs that show it
    /// best.
    pub moved: Vec<Option<Moved>>,
    pub other_place: Vec<Option<OtherPlace>>,
    pub needed: Vec<Needed>,
}

impl<'a> History<'a> {
    pub fn new(log: &'a Log, signals: &'a [Signal], verdict: Watch, model: Option<&ErrorModel>) -> Self {
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
            signals,
            verdict,
        }
    }
}

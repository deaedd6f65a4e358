//! Still recordings: the rate at one position against the channels, hours long. There is no azimuth in them; the rate's bias is what is learned.

use super::statistics::rms;
use crate::campaign::Role;
use crate::run_data::RunData;

/// Whether the campaign has still recordings only.
pub fn is_still(runs: &[RunData]) -> bool {
    runs.iter().all(|run| run.before.is_none() && run.at_one_position())
}

/// The first half of every recording may be learned from, the second one judges; where the campaign gives both roles, whole recordings have theirs.
pub fn halves(runs: Vec<RunData>) -> Vec<RunData> {
    if [Role::Fit, Role::Check].iter().all(|role| runs.iter().any(|run| run.role == *role)) {
        return runs;
    }
    let half = |run: &RunData, role: Role| {
        let mut half = run.clone();
        let middle = half.samples.len() / 2;
        let (first, second) = half.samples.split_at_mut(middle);
        let (other, name) = if role == Role::Fit { (second, "first half") } else { (first, "second half") };
        other.iter_mut().for_each(|sample| sample.left_out = true);
        half.role = role;
        half.file = format!("{} ({name})", run.file);
        half
    };
    runs.iter().flat_map(|run| [half(run, Role::Fit), half(run, Role::Check)]).collect()
}

/// Root mean square of the rate about its mean in what nothing was learned from, °/h.
pub fn rate_rms_deg_h(runs: &[RunData]) -> f64 {
    let of_run = |run: &RunData| {
        let rates: Vec<f64> =
            run.samples.iter().filter(|sample| run.enters(sample)).map(|sample| sample.rate_deg_h).collect();
        let mean = rates.iter().sum::<f64>() / rates.len() as f64;
        rates.into_iter().map(|rate| rate - mean).collect::<Vec<f64>>()
    };
    rms(&runs.iter().filter(|run| run.role == Role::Check).flat_map(of_run).collect::<Vec<f64>>())
}

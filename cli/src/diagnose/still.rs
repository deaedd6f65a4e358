//! Still recordings: the rate at one position against the channels, hours long. There is no azimuth in them; the rate's bias is what is learned.

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

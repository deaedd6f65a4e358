//! A line with a phase of each run's own: nothing that a model could know beforehand.

use super::Effect;
use super::data::RunData;
use super::estimate::Learned;
use super::learn::STRUCTURE;
use super::noise;
use super::residual::Residuals;
use super::statistics::chi_square_tail;

/// Looks for a line in what the effects leave of these runs.
pub fn own(runs: &[&RunData], learned: &Learned) -> Option<Effect> {
    let residuals = Residuals::new(runs.to_vec(), &learned.taken, None);
    let (period_s, amplitude_deg_h, p_value) = noise::line(runs, &residuals.after)?;
    Some(Effect {
        name: "line".into(),
        kind: "bias",
        channel: None,
        parameters: [("period_s".to_owned(), period_s), ("amplitude_deg_h".to_owned(), amplitude_deg_h)].into(),
        sigma: Default::default(),
        p_value: p_value.min(1.0),
        ambiguous_with: Vec::new(),
        evidence:
            "a line in the periodogram with a phase of its own in every run: it averages out over a stay, and no \
                   model can foretell it"
                .into(),
        board: false,
    })
}

/// Whether a line beside the effects is what was left without it: at least half of the structure, if there was any.
pub fn explains(without: &Learned, with: &Learned) -> bool {
    let structure = |learned: &Learned| (learned.left - 1.0) * learned.left_freedom;
    let p_value = chi_square_tail(without.left * without.left_freedom, without.left_freedom);
    p_value >= STRUCTURE || structure(with) < 0.5 * structure(without)
}

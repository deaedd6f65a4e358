//! A sinusoidal disturbance with a phase of each run's own: nothing that a model could know beforehand.

use north_finder::effects::Sinusoid;

use super::Effect;
use super::learn::STRUCTURE;
use super::learned::Learned;
use super::noise;
use super::problem::BLOCK_SAMPLES;
use super::residual::Residuals;
use super::statistics::chi_square_tail;
use crate::run_data::RunData;

/// Share of the structure that may be left beside a sinusoid.
const REST: f64 = 0.2;

/// A sinusoidal disturbance with a phase of each run's own.
#[derive(Clone, Copy, Debug)]
pub struct OwnSinusoid {
    pub period_s: f64,
    pub amplitude_deg_h: f64,
    p_value: f64,
}

impl OwnSinusoid {
    /// Looks for a sinusoid in what the effects leave of these runs.
    pub fn find(runs: &[&RunData], learned: &Learned) -> Option<Self> {
        let residuals = Residuals::new(runs.to_vec(), &learned.taken, None);
        let (period_s, amplitude_deg_h, p_value) = noise::sinusoid(runs, &residuals.after)?;
        Some(Self { period_s, amplitude_deg_h, p_value })
    }

    pub fn sinusoid(&self) -> Sinusoid {
        Sinusoid { period_s: self.period_s, amplitude_deg_h: self.amplitude_deg_h }
    }

    pub fn effect(&self) -> Effect {
        let parameters = [("period_s", self.period_s), ("amplitude_deg_h", self.amplitude_deg_h)];
        Effect {
            name: "sinusoid".into(),
            kind: "bias",
            channel: None,
            channels: Vec::new(),
            parameters: parameters.map(|(name, value)| (name.to_owned(), value)).into(),
            sigma: Default::default(),
            p_value: self.p_value.min(1.0),
            ambiguous_with: Vec::new(),
            evidence:
                "a sinusoidal disturbance in the periodogram with a phase of its own in every run: no model can predict it, but a fix \
                       can estimate its two parts"
                    .into(),
            board: true,
        }
    }
}

/// Whether a sinusoid beside the effects is what was left without it. A slow one shows in the means over blocks of seconds, and
/// must take nearly all of what these show; a fast one averages out in them.
pub fn explains(sinusoid_period_s: f64, without: &Learned, with: &Learned) -> bool {
    let structure = |learned: &Learned| (learned.left - 1.0) * learned.left_freedom;
    let p_value = chi_square_tail(without.left * without.left_freedom, without.left_freedom);
    let shows = p_value < STRUCTURE;
    (!shows && sinusoid_period_s < 2.0 * BLOCK_SAMPLES as f64) || (shows && structure(with) < REST * structure(without))
}

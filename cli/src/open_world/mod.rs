//! An open world: effects outside every dictionary, by groups of basis functions that the evidence chooses.
//!
//! For every run y = A (h cos ψ, h sin ψ, bias) + Σ Φ w + u(t) + white noise. A group's weights have one prior variance;
//! u is a process of the run's own, whose kernel comes from a mixture that the training runs share.

mod basis;
mod columns;
mod course;
mod dynamics;
mod evidence;
mod expected;
mod group;
mod learn;
mod predict;
mod process;
mod recording;
mod run;
mod sheet;
mod tie;
mod tuned;

pub use basis::{DECAYS_S, MEMORY_S, RELAXATION_S, TRAVEL_S, WARM_UP_S};
pub use expected::Expected;
pub use group::{Base, Group, PLAY_WIDTHS, TIMES_S};
pub use predict::{Found, InFunctions, Learned, Model, Prediction, root_of_mean, studentised};
pub use process::{DAMPING, Kernel, Shape};
pub use recording::{Recording, Reference};
pub use tuned::Tuned;

use learn::Search;

/// Learns from recordings that have the same channels. `None` where no run has enough in it.
pub fn learn(recordings: &[&Recording]) -> Option<Learned> {
    let channels = recordings.first()?.channels.len();
    let mut search = Search::new(recordings, channels)?;
    let state = search.learn();
    let alternatives = search.alternatives(&state);
    Some(Learned::new(&search, &state, &alternatives))
}

#[cfg(test)]
mod tests;

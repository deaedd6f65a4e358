//! An open world: effects outside every dictionary, by groups of basis functions that the evidence chooses.
//!
//! For every run y = A (h cos ψ, h sin ψ, bias) + Σ Φ w + u(t) + white noise. A group's weights have one prior variance;
//! u is a process of the run's own, whose kernel comes from a mixture that the training runs share.

mod atom;
mod basis;
mod candidates;
mod columns;
mod course;
mod dictionary;
mod differences;
mod dynamics;
mod evidence;
mod expected;
mod group;
mod habits;
mod heading;
mod learn;
mod least_squares;
mod levels;
mod of_two;
mod predict;
mod process;
mod proposals;
mod recording;
mod rhythm;
mod rhythm_search;
mod run;
mod seen;
mod sheet;
mod switching;
mod switching_search;
mod tie;
mod tuned;
mod waves;

pub use basis::{DECAYS_S, MEMORY_S, RELAXATION_S, TRAVEL_S, WARM_UP_S};
pub use expected::Expected;
pub use group::{Base, Group, PLAY_WIDTHS, TIMES_S};
pub use least_squares::Prediction;
pub use predict::{Found, InFunctions, Learned, MARGIN_OF_PROCESSES, Model, root_of_mean, studentised};
pub use process::{DAMPING, Kernel, PROCESS, Shape};
pub use recording::{Recording, Reference};
pub use tuned::Tuned;

use learn::Search;

/// Learns from recordings that have the same channels. `None` where no run has enough in it.
pub fn learn(recordings: &[&Recording]) -> Option<Learned> {
    let channels = recordings.first()?.channels.len();
    let mut search = Search::new(recordings, channels)?;
    let learned = search.learn().into_iter().map(|candidate| {
        search.adopt(&candidate);
        let alternatives = search.alternatives(&candidate.state);
        Learned::new(&search, &candidate.state, &alternatives)
    });
    learned.reduce(|best, other| if other.is_better_than(&best) { other } else { best })
}

#[cfg(test)]
mod tests;

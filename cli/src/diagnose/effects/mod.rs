//! Candidate effects, built from what a campaign has: its channels whatever their names, its times, angles and rates. One
//! file a cause: its forms, and the grids of their constants.

pub mod base_motion;
mod body;
mod channel;
mod earth;
mod index;
mod rate;
mod settling;
mod time;

use super::candidate::Candidate;
use crate::run_data::RunData;

/// Lengths that the grids of constants are made of.
struct Scales {
    /// The longest run and the longest first row, seconds.
    longest_s: f64,
    step_s: f64,
}

/// Every candidate that the runs allow.
pub fn all(runs: &[&RunData], constant_channels: &[String]) -> Vec<Candidate> {
    let mut list = Vec::new();
    let Some(first) = runs.first() else { return list };
    let scales = Scales {
        longest_s: runs.iter().filter_map(|run| run.samples.last()).map(|sample| sample.t_s).fold(0.0, f64::max),
        step_s: runs.iter().filter_map(|run| run.samples.first()).map(|sample| sample.seconds).fold(1.0, f64::max),
    };
    for name in first.channel_names().iter().filter(|name| !constant_channels.contains(name)) {
        channel::candidates(&mut list, name, runs, &scales);
    }
    time::slow(&mut list, &scales);
    settling::candidates(&mut list, &scales);
    body::harmonics(&mut list);
    rate::candidates(&mut list, runs);
    earth::candidates(&mut list);
    index::candidates(&mut list);
    time::sudden(&mut list, runs, &scales);
    if runs.iter().all(|run| run.channel("ax_g").is_some()) {
        base_motion::candidates(&mut list);
        body::tilted(&mut list, first.earth.up_deg_h);
    }
    list
}

/// Logarithmic grid.
fn geometric(from: f64, to: f64, steps: usize) -> Vec<f64> {
    (0..steps).map(|i| from * (to / from).powf(i as f64 / (steps.max(2) - 1) as f64)).collect()
}

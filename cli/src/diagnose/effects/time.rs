//! What goes with the time since switch-on: drift and warm-up; a sinusoidal disturbance and a step, always the same.

use north_finder::effects::basis::drift::Drift;
use north_finder::effects::basis::line::Line;
use north_finder::effects::basis::step::Step;
use north_finder::effects::basis::warm_up::WarmUp;
use north_finder::effects::{Basis, Term};

use super::{Candidate, RunData, Scales, geometric};

/// Most periods of a sinusoid that are tried.
const MOST_PERIODS: usize = 200;

pub fn slow(list: &mut Vec<Candidate>, scales: &Scales) {
    for degree in [1, 2] {
        list.push(Candidate::term(Term::new(Basis::Drift(Drift { degree })), vec![]));
    }
    let taus = geometric(4.0 * scales.step_s, 4.0 * scales.longest_s, 9);
    list.push(Candidate::term(Term::new(Basis::WarmUp(WarmUp { tau_s: 1.0 })), taus));
}

pub fn sudden(list: &mut Vec<Candidate>, runs: &[&RunData], scales: &Scales) {
    // Frequencies from two periods in the longest run to half the rate of the samples, half a resolution apart, or more
    // where they would be too many.
    let lines = (scales.longest_s / scales.step_s) as usize;
    let stride = lines.div_ceil(MOST_PERIODS).max(1);
    let periods = (4..lines).step_by(stride).map(|n| 2.0 * scales.longest_s / n as f64).collect();
    list.push(Candidate::term(Term::new(Basis::Line(Line { period_s: 1.0 })), periods));
    // In three dwells a step between two of them is another azimuth and bias.
    if runs.iter().any(|run| run.rotation || run.samples.last().is_some_and(|sample| sample.dwell >= 3)) {
        let steps = (1..32).map(|n| scales.longest_s * f64::from(n) / 32.0).collect();
        list.push(Candidate::term(Term::new(Basis::Step(Step { t_s: 0.0 })), steps));
    }
}

//! What follows a channel: its value, earlier or later, its rate of change, straight or curved; and the scale factor by it.

use north_finder::effects::basis::MAX_FUNCTIONS;
use north_finder::effects::basis::curve::Curve;
use north_finder::effects::basis::curve::function::{Function, Knots};
use north_finder::effects::basis::curve::signal::Signal;
use north_finder::effects::{Basis, ChannelName, Term};

use super::{Candidate, RunData, Scales, geometric};

pub fn candidates(list: &mut Vec<Candidate>, name: &str, runs: &[&RunData], scales: &Scales) {
    let Some(channel) = ChannelName::new(name) else { return };
    let values: Vec<f64> = runs.iter().filter_map(|run| run.channel(name)).flatten().collect();
    if values.is_empty() || runs.iter().any(|run| run.channel(name).is_none()) {
        return;
    }
    // A reference that reads well.
    let mean = (values.iter().sum::<f64>() / values.len() as f64) as f32;
    let basis = |signal, function| Basis::Curve(Curve { channel, signal, function });
    let powers = |degree| Function::Powers { reference: mean, degree };
    let slope = Function::Powers { reference: 0.0, degree: 1 };
    let mut add = |signal, function, grid| list.push(Candidate::term(Term::new(basis(signal, function)), grid));
    add(Signal::Value, powers(1), vec![]);
    if name == "ax_g" || name == "ay_g" {
        return;
    }
    add(Signal::Value, powers(2), vec![]);
    add(Signal::Value, powers(3), vec![]);
    for knots in splines(values) {
        add(Signal::Value, Function::Spline(knots), vec![]);
    }
    let rate = |curved, low_pass_s| Signal::Rate { samples: 6, curved, low_pass_s };
    add(rate(false, 0.0), slope.clone(), vec![3.0, 6.0, 12.0, 30.0]);
    add(rate(true, 0.0), slope.clone(), vec![4.0, 8.0, 15.0, 30.0]);
    add(Signal::Lag { lag_s: 0.0 }, powers(1), geometric(3.0, 30.0, 5));
    add(Signal::LowPass { tau_s: 0.0 }, powers(1), geometric(5.0, scales.longest_s, 7));
    add(rate(false, 1.0), slope, geometric(10.0, scales.longest_s, 6));
    list.push(Candidate::term(Term::scaling(basis(Signal::Value, powers(1))), vec![]));
}

/// Knots of splines that may follow a curve: few and many at quantiles of the values, the outer ones at 5 % and 95 %
/// (Harrell, Regression modeling strategies, 2001, section 2.4.5); and many evenly between the same, or in a part of it for a
/// sharp bend between straight lines.
fn splines(mut values: Vec<f64>) -> Vec<Knots> {
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
    let quantiles = |count: usize| (0..count).map(|i| at(0.05 + 0.9 * i as f64 / (count - 1) as f64)).collect();
    let (low, high) = (at(0.05), at(0.95));
    let even = |(from, to): (f64, f64)| {
        let at = |i: usize| low + (high - low) * (from + (to - from) * i as f64 / (MAX_FUNCTIONS - 1) as f64);
        (0..MAX_FUNCTIONS).map(at).collect()
    };
    let parts = [(0.0, 1.0), (0.0, 0.6), (0.2, 0.8), (0.4, 1.0)];
    let knots: Vec<Vec<f64>> = [quantiles(4), quantiles(MAX_FUNCTIONS)].into_iter().chain(parts.map(even)).collect();
    let single = |knots: Vec<f64>| knots.into_iter().map(|knot| knot as f32).collect::<Knots>();
    let rising = |knots: &Knots| knots.windows(2).all(|pair| pair[1] > pair[0]);
    knots.into_iter().map(single).filter(rising).collect()
}

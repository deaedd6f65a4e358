//! How what comes out of signals and dynamics is spread over runs.

use north_finder::effects::factor::Factor;
use north_finder::effects::part::Span;
use north_finder::effects::shape::{Linear, Shape};

use super::rows::Run;

/// A signal that varies by less than this share of its size is constant.
const CONSTANT: f64 = 1e-9;

/// A shape that gives what it gets: what a span is measured through.
pub const IDENTITY: Shape = Shape::Linear(Linear { reference: 0.0, scale: 1.0 });

/// How these values are spread, which come out of a factor's dynamics in the rows at rest; `None` where it says nothing or does not vary.
pub fn span(runs: &[Run], factor: &Factor, inputs: &[f64]) -> Option<Span> {
    let values: Vec<f64> = inputs.iter().copied().filter(|value| value.is_finite()).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let deviation = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (row_s, longest_s) =
        runs.iter().map(Run::lengths_s).fold((f64::INFINITY, 0.0), |a: (f64, f64), b| (a.0.min(b.0), a.1.max(b.1)));
    let signal = factor.signal;
    (deviation > CONSTANT * (mean.abs() + f64::MIN_POSITIVE)).then_some(Span {
        mean,
        deviation,
        low,
        high,
        is_angle: signal.is_angle() && factor.dynamics.is_empty(),
        is_time: signal.is_time(),
        row_s,
        longest_s: if signal.is_time() { f64::max(longest_s, high) } else { longest_s },
    })
}

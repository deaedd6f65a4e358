//! Runs side by side: what is left of their rates beside every run's own unknowns.

use super::run_residual::{OWN_UNKNOWNS, RunResidual};

/// Seconds that are averaged for the test whether what is left is white.
const BLOCK_SAMPLES: usize = 12;

/// Runs side by side.
pub struct Problem<'a> {
    pub residuals: Vec<RunResidual<'a>>,
    y: Vec<f64>,
}

impl<'a> Problem<'a> {
    pub fn new(residuals: Vec<RunResidual<'a>>) -> Self {
        let y = residuals.iter().flat_map(|residual| residual.project(&residual.y)).collect();
        Self { residuals, y }
    }

    /// The residual of all runs, their own unknowns taken out; in units of its noise.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// The rows of a run in the layout of [`Self::y`].
    pub fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.residuals.iter().scan(0, |start, residual| {
            let range = *start..*start + residual.y.len();
            *start = range.end;
            Some(range)
        })
    }

    /// Sum of squares of means over blocks of seconds inside dwells, over its degrees of freedom: 1 for white noise, and where there are fewer than three.
    pub fn overdispersion(&self, left: &[f64]) -> f64 {
        let (sum, freedom) =
            self.dispersions(left).into_iter().fold((0.0, 0.0), |all, run| (all.0 + run.0, all.1 + run.1));
        if freedom >= 3.0 { sum / freedom } else { 1.0 }
    }

    /// Of every run: sum of squares of means over blocks of seconds inside dwells, in units of white noise, and its degrees of freedom.
    pub fn dispersions(&self, left: &[f64]) -> Vec<(f64, f64)> {
        self.residuals.iter().zip(self.ranges()).map(|(residual, range)| dispersion(residual, &left[range])).collect()
    }
}

/// Sum of squares of means over blocks of seconds inside dwells, in units of white noise, and its degrees of freedom.
fn dispersion(residual: &RunResidual, left: &[f64]) -> (f64, f64) {
    let (mut sum, mut count) = (0.0, 0.0);
    let (mut total, mut number, mut dwell) = (0.0, 0.0, usize::MAX);
    let mut flush = |total: &mut f64, number: &mut f64| {
        if *number > 0.0 {
            sum += *total * *total / *number;
            count += 1.0;
        }
        (*total, *number) = (0.0, 0.0);
    };
    for ((sample, weight), value) in residual.run.samples.iter().zip(&residual.root_weight).zip(left) {
        if sample.dwell != dwell || number >= BLOCK_SAMPLES as f64 {
            flush(&mut total, &mut number);
            dwell = sample.dwell;
        }
        if *weight > 0.0 {
            total += value;
            number += 1.0;
        }
    }
    flush(&mut total, &mut number);
    (sum, count - OWN_UNKNOWNS)
}

//! A rhythm: what repeats itself with the same period and the same form in every run, at a phase of each run's own.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::columns::{Columns, from_columns};
use super::sheet::Sheet;

/// Most harmonics, and seconds of the period for each of them: faster ones are averaged out within a second.
const MOST_HARMONICS: usize = 20;
const SECONDS_OF_HARMONIC: f64 = 2.0;
/// Phases that a run may have at first sight; those less likely than the best one by this (log odds) are left out.
const PHASES: usize = 64;
const UNLIKELY: f64 = 9.0;
/// Rounds in which the phases that are left are looked at in finer steps, how many in the place of one, and most that are left then.
const ROUNDS: usize = 3;
const FINER: usize = 4;
const MOST_PHASES: usize = 12;

/// The constants that runs share; the form is a sum of harmonics whose weights are learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rhythm {
    pub period_s: f64,
    /// Power of its order by which a harmonic is expected to be smaller: 0 for spikes, 1 for steps, 2 for bends.
    pub smoothness: i32,
    /// Where the form follows its cause behind a low-pass that begins at nothing with the run: the time constant.
    pub begins_s: Option<f64>,
    /// Harmonics.
    pub orders: usize,
}

/// As many harmonics as a period of this length may show.
pub fn orders(period_s: f64) -> usize {
    ((period_s / SECONDS_OF_HARMONIC) as usize).clamp(1, MOST_HARMONICS)
}

impl Rhythm {
    /// Cosines and sines of all orders over the samples at a phase in the middle of the run (in periods). What begins at nothing lacks
    /// what it would be at the beginning, dying away; its mean, too, is approached, and is the last column.
    pub fn columns(&self, sheet: &Sheet, phase: f64) -> Columns {
        let t_s = &sheet.recording.t_s;
        let begin_s = sheet.recording.start_s();
        let middle_s = 0.5 * (begin_s + t_s.last().copied().unwrap_or(0.0));
        let gone: Vec<f64> = t_s.iter().map(|t_s| self.gone(t_s - begin_s)).collect();
        let angle = |t_s: f64| TAU * ((t_s - middle_s) / self.period_s + phase);
        let of = |order: usize, part: fn(f64) -> f64| {
            let order = order as f64;
            let first = part(order * angle(begin_s));
            let value =
                |(t_s, gone): (&f64, &f64)| order.powi(-self.smoothness) * (part(order * angle(*t_s)) - first * gone);
            sheet.samples.means(t_s.iter().zip(&gone).map(value))
        };
        let harmonics = (1..=self.orders).flat_map(|order| [of(order, f64::cos), of(order, f64::sin)]);
        let mean = self.begins_s.map(|_| sheet.samples.means(gone.iter().map(|gone| 1.0 - gone)));
        from_columns(sheet.samples.len(), harmonics.chain(mean))
    }

    /// What is left of a beginning after a time.
    fn gone(&self, since_s: f64) -> f64 {
        self.begins_s.map_or(0.0, |time_s| (-since_s / time_s).exp())
    }

    /// Weights that at phase 0 do what these do at a phase.
    pub fn turned(&self, weights: &DVector<f64>, phase: f64) -> DVector<f64> {
        let mut turned = weights.clone();
        for order in 1..=self.orders {
            let (sin, cos) = (TAU * order as f64 * phase).sin_cos();
            let (a, b) = (weights[2 * order - 2], weights[2 * order - 1]);
            turned[2 * order - 2] = a * cos + b * sin;
            turned[2 * order - 1] = b * cos - a * sin;
        }
        turned
    }

    /// Columns at a phase, from rows of those at phase 0.
    pub fn turn(&self, columns: &DMatrix<f64>, phase: f64) -> DMatrix<f64> {
        let mut turned = columns.clone();
        for order in 1..=self.orders {
            let (sin, cos) = (TAU * order as f64 * phase).sin_cos();
            let (first, second) = (columns.column(2 * order - 2), columns.column(2 * order - 1));
            turned.set_column(2 * order - 2, &(first * cos - second * sin));
            turned.set_column(2 * order - 1, &(second * cos + first * sin));
        }
        turned
    }
}

/// Phases that remain possible, with their probabilities, the likeliest first: those that a log-likelihood speaks for, in finer steps
/// where they are few.
pub fn possible_phases(log_likelihood: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let mut step = 1.0 / PHASES as f64;
    let all = (0..PHASES).map(|number| number as f64 * step);
    let mut found: Vec<(f64, f64)> = all.map(|phase| (log_likelihood(phase), phase)).collect();
    let mut most = greatest(&found);
    for _ in 0..ROUNDS {
        found.retain(|each| each.0 > most - UNLIKELY);
        if found.len() > MOST_PHASES {
            break;
        }
        step /= FINER as f64;
        let near = |phase: f64| (0..FINER).map(move |i| phase + step * (i as f64 - 0.5 * (FINER - 1) as f64));
        found = found.iter().flat_map(|each| near(each.1)).map(|phase| (log_likelihood(phase), phase)).collect();
        most = greatest(&found);
    }
    found.retain(|each| each.0 > most - UNLIKELY);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let total: f64 = found.iter().map(|each| (each.0 - most).exp()).sum();
    found.into_iter().map(|(value, phase)| ((value - most).exp() / total, phase)).collect()
}

fn greatest(found: &[(f64, f64)]) -> f64 {
    found.iter().map(|each| each.0).fold(f64::NEG_INFINITY, f64::max)
}

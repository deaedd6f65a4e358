//! What runs share of a rate that goes to and fro between two levels: the numbers by expectation and maximisation.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::levels::Switching;
use super::recording::median;
use super::run::Run;
use super::seen::Seen;
use super::switching::Statistics;

/// Most runs that are learned from.
const RUNS: usize = 24;
/// Rounds with levels of each run's own, and then with levels that runs share.
const ROUNDS: usize = 2;
const SHARED_ROUNDS: usize = 3;
/// Switches in a run at first.
const FIRST_SWITCHES: f64 = 4.0;
/// Levels differ by so many root mean squares of what is left at first; spread of a difference that runs share, at first and at least.
const FIRST_STEP: f64 = 2.0;
const FIRST_SPREAD: f64 = 0.3;
const LEAST_SPREAD: f64 = 0.01;
/// Share of the prior variance below which a run tells how far apart its levels are, and standard deviations that such a difference stands
/// out by.
const TELLS: f64 = 0.5;
const STANDS_OUT: f64 = 3.0;
/// Switches that count beside those that were found.
const LITTLE: f64 = 0.5;

/// In what effects leave of runs (by the sample), where they show levels that differ: first with differences of each run's own, which steps
/// do as well, then with one that they share.
pub fn find(runs: &[Run<'_>], residuals: &[DVector<f64>]) -> Option<Switching> {
    let some: Vec<(Seen<'_>, &DVector<f64>)> =
        runs.iter().zip(residuals).take(RUNS).map(|(run, residual)| (run.seen(true), residual)).collect();
    let statistics = |switching: &Switching| -> Vec<Statistics> {
        some.par_iter().map(|(run, residual)| switching.statistics(run, residual)).collect()
    };
    let mean_square = some.iter().map(|(run, residual)| mean_square(run, residual)).sum::<f64>() / some.len() as f64;
    let length_s = |(run, _): &(Seen<'_>, &DVector<f64>)| {
        run.sheet.recording.t_s.last().unwrap_or(&0.0) - run.sheet.recording.start_s()
    };
    let length_s = some.iter().map(length_s).sum::<f64>() / some.len() as f64;
    let spread_deg_h = FIRST_STEP * mean_square.sqrt();
    if !(spread_deg_h > 0.0 && length_s > 0.0) {
        return None;
    }
    let mut own = Switching { mean_s: [length_s / FIRST_SWITCHES; 2], step_deg_h: 0.0, spread_deg_h };
    for _ in 0..ROUNDS {
        own = of_each_run(&statistics(&own), length_s);
    }
    let of_runs = statistics(&own);
    let steps = of_runs.iter().filter(|each| each.step_deg_h > STANDS_OUT * each.variance.sqrt());
    let step_deg_h = median(steps.map(|each| each.step_deg_h).collect());
    if step_deg_h <= 0.0 {
        return None;
    }
    let mut shared =
        Switching { step_deg_h, spread_deg_h: FIRST_SPREAD * step_deg_h, mean_s: mean_s(&of_runs, length_s) };
    for _ in 0..SHARED_ROUNDS {
        shared = shared_by(&statistics(&shared), &shared, length_s);
    }
    Some(shared)
}

/// Weighted mean square of what a run's own unknowns leave, °²/h².
fn mean_square(run: &Seen<'_>, residual: &DVector<f64>) -> f64 {
    let design = DMatrix::from_fn(residual.len(), 3, |i, j| run.design[(i, j)] * run.roots[i]);
    let q = design.qr().q();
    let rate = residual.component_mul(&run.roots);
    (&rate - &q * q.tr_mul(&rate)).norm_squared() / run.roots.norm_squared()
}

/// Mean times at both levels.
fn mean_s(of_runs: &[Statistics], length_s: f64) -> [f64; 2] {
    let of_level = |level: usize| {
        let spent_s: f64 = of_runs.iter().map(|each| each.spent_s[level]).sum();
        let left: f64 = of_runs.iter().map(|each| each.left[level]).sum();
        (spent_s + LITTLE * length_s) / (left + LITTLE)
    };
    [of_level(0), of_level(1)]
}

/// Levels that are neither lower nor upper are left alike.
fn of_each_run(of_runs: &[Statistics], length_s: f64) -> Switching {
    let spent_s: f64 = of_runs.iter().flat_map(|each| each.spent_s).sum();
    let left: f64 = of_runs.iter().flat_map(|each| each.left).sum();
    let squares = of_runs.iter().map(|each| each.step_deg_h.powi(2) + each.variance);
    let spread_deg_h = (squares.sum::<f64>() / of_runs.len() as f64).sqrt();
    let mean_s = (spent_s + LITTLE * length_s) / (left + LITTLE);
    Switching { mean_s: [mean_s; 2], step_deg_h: 0.0, spread_deg_h }
}

fn shared_by(of_runs: &[Statistics], before: &Switching, length_s: f64) -> Switching {
    let telling: Vec<&Statistics> =
        of_runs.iter().filter(|each| each.variance < TELLS * before.spread_deg_h.powi(2)).collect();
    let mean_s = mean_s(of_runs, length_s);
    if telling.is_empty() {
        return Switching { mean_s, ..*before };
    }
    let number = telling.len() as f64;
    let step_deg_h = telling.iter().map(|each| each.step_deg_h).sum::<f64>() / number;
    let squares = telling.iter().map(|each| (each.step_deg_h - step_deg_h).powi(2) + each.variance).sum::<f64>();
    Switching { mean_s, step_deg_h, spread_deg_h: (squares / number).sqrt().max(LEAST_SPREAD * step_deg_h) }
}

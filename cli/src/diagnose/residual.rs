//! What is left of every run, before and after.

use north_finder::units::wrap_360_deg;
use rayon::prelude::*;

use super::noise::{self, Residual, SIGNIFICANCE};
use super::problem::Problem;
use super::result::{RunSeries, Test};
use super::run_residual::RunResidual;
use super::statistics::{chi_square_tail, median, rms};
use crate::campaign::Role;
use crate::run_data::RunData;

/// The residual of every run by the sample, its own azimuth and bias taken out; °/h.
pub struct Residuals<'a> {
    runs: Vec<&'a RunData>,
    pub before: Vec<Residual>,
    pub after: Vec<Residual>,
    /// Noise of a second: the middle of all runs, °/h.
    pub noise_deg_h: f64,
    pub tests_before: Vec<Test>,
    pub tests_after: Vec<Test>,
    dispersion_before: Vec<Option<Dispersion>>,
    dispersion_after: Vec<Option<Dispersion>>,
}

/// Sum of squares of a run's means over blocks of seconds, in units of white noise, and its degrees of freedom.
type Dispersion = (f64, f64);

/// What effects leave of the runs.
struct Left {
    residuals: Vec<Residual>,
    /// Noise of a second of each run, °/h.
    noises: Vec<f64>,
    dispersions: Vec<Option<Dispersion>>,
    /// Of all runs together.
    tests: Vec<Test>,
}

impl<'a> Residuals<'a> {
    /// Before, and after a model was taken out of the same runs (`without`).
    pub fn new(runs: Vec<&'a RunData>, without: Vec<&RunData>) -> Self {
        let (before, after) = (left(&runs), left(&without));
        Self {
            runs,
            before: before.residuals,
            after: after.residuals,
            noise_deg_h: median(before.noises.into_iter().filter(|noise| noise.is_finite()).collect()),
            tests_before: before.tests,
            tests_after: after.tests,
            dispersion_before: before.dispersions,
            dispersion_after: after.dispersions,
        }
    }

    /// Runs in which what was learned does not hold, by their files, with how many times as much as white noise is left without it and
    /// with it.
    pub fn contradicted(&self) -> Vec<(String, f64, f64)> {
        let of_run = |(run, (before, after)): (&&RunData, (&Option<Dispersion>, &Option<Dispersion>))| {
            let ((before, _), (after, freedom)) = ((*before)?, (*after)?);
            let amount = |sum: f64| (sum / freedom).sqrt();
            let against = speaks_against(before, after, freedom, self.runs.len());
            against.then(|| (run.file.clone(), amount(before), amount(after)))
        };
        self.runs.iter().zip(self.dispersion_before.iter().zip(&self.dispersion_after)).filter_map(of_run).collect()
    }

    /// Over the check runs, or all if there are none.
    pub fn judged_rms(&self, residuals: &[Residual]) -> f64 {
        let any_check = self.runs.iter().any(|run| run.role == Role::Check);
        let values: Vec<f64> = self
            .runs
            .iter()
            .zip(residuals)
            .filter(|(run, _)| !any_check || run.role == Role::Check)
            .flat_map(|(_, residual)| residual.iter().copied())
            .filter(|value| value.is_finite())
            .collect();
        rms(&values)
    }

    pub fn spectra(&self, white_deg_h: f64) -> super::Spectra {
        noise::spectra(&self.runs, &self.before, &self.after, white_deg_h)
    }

    /// For drawing.
    pub fn series(&self) -> Vec<RunSeries> {
        let channels = |run: &RunData| {
            run.channel_names().into_iter().filter_map(|name| run.channel(&name).map(|values| (name, values))).collect()
        };
        self.runs
            .iter()
            .zip(self.before.iter().zip(&self.after))
            .map(|(run, (before, after))| RunSeries {
                file: run.file.clone(),
                t_s: run.samples.iter().map(|sample| sample.t_s).collect(),
                seconds: run.samples.iter().map(|sample| sample.seconds).collect(),
                index_deg: run
                    .samples
                    .iter()
                    .map(|sample| wrap_360_deg(sample.sin.atan2(sample.cos).to_degrees()))
                    .collect(),
                residual_before_deg_h: before.clone(),
                residual_after_deg_h: after.clone(),
                channels: channels(run),
            })
            .collect()
    }

    /// The same with what is left of each dwell in the place of its rows.
    pub fn series_of(&self, dwells: &Residuals<'_>) -> Vec<RunSeries> {
        let (mut all, of_dwells) = (self.series(), dwells.series());
        for series in &mut all {
            let Some(of_dwells) = of_dwells.iter().find(|of_dwells| of_dwells.file == series.file) else { continue };
            for (i, &t_s) in series.t_s.iter().enumerate() {
                let mut lengths = of_dwells.t_s.iter().zip(&of_dwells.seconds);
                let dwell = lengths.position(|(middle_s, seconds)| (t_s - middle_s).abs() <= 0.5 * seconds);
                let left = |of_dwells: &[f64]| dwell.map_or(f64::NAN, |dwell| of_dwells[dwell]);
                series.residual_before_deg_h[i] = left(&of_dwells.residual_before_deg_h);
                series.residual_after_deg_h[i] = left(&of_dwells.residual_after_deg_h);
            }
        }
        all
    }
}

/// How many times as much as white noise is left of runs together, root mean square over blocks of seconds; 1 where there is too little to tell it by.
pub fn in_white_noises(runs: &[&RunData]) -> f64 {
    let problem = Problem::new(runs.par_iter().filter_map(|run| RunResidual::new(run)).collect());
    problem.overdispersion(problem.y()).sqrt()
}

fn left(runs: &[&RunData]) -> Left {
    let residuals: Vec<Option<RunResidual>> = runs.par_iter().map(|run| RunResidual::new(run)).collect();
    let present: Vec<bool> = residuals.iter().map(Option::is_some).collect();
    let problem = Problem::new(residuals.into_iter().flatten().collect());
    let ranges: Vec<_> = problem.ranges().collect();
    let mut found = problem.residuals.iter().zip(ranges).map(|(run, range)| {
        let unweighted = problem.y()[range].iter().zip(&run.root_weight);
        let residual: Residual =
            unweighted.map(|(z, weight)| if *weight > 0.0 { z / weight } else { f64::NAN }).collect();
        (residual, run.noise_deg_h)
    });
    let of_run = |(run, present): (&&RunData, &bool)| {
        let nothing = || (vec![f64::NAN; run.samples.len()], f64::NAN);
        if *present { found.next().unwrap_or_else(nothing) } else { nothing() }
    };
    let (residuals, noises) = runs.iter().zip(&present).map(of_run).unzip();
    let mut dispersions = problem.dispersions(problem.y()).into_iter();
    let dispersions = present.iter().map(|present| present.then(|| dispersions.next()).flatten()).collect();
    Left { residuals, noises, dispersions, tests: noise::tests(&problem, problem.y()) }
}

/// Whether a run speaks against what was learned: more is left with it than without it, and so much more than white noise that chance
/// would do as much in one of so many runs with a probability below [`SIGNIFICANCE`]. Sums of squares in units of white noise.
fn speaks_against(before: f64, after: f64, freedom: f64, runs: usize) -> bool {
    freedom > 0.0 && after > before && chi_square_tail(after, freedom) < SIGNIFICANCE / runs as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two degrees of freedom the tail is e^(−χ²/2): 1e-4, a thousandth shared by ten runs, at χ² = 18.42.
    #[test]
    fn a_run_speaks_against_what_was_learned_by_hand() {
        assert!(speaks_against(5.0, 18.5, 2.0, 10));
        assert!(!speaks_against(5.0, 18.3, 2.0, 10));
        // What was there before is no fault of what was learned.
        assert!(!speaks_against(30.0, 18.5, 2.0, 10));
        assert!(!speaks_against(0.0, 18.5, 0.0, 10));
    }
}

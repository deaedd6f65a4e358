//! The azimuth of a run by what was learned: generalised least squares, averaged over what remains possible.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::basis::{Scales, centre};
use super::columns::{from_columns, of_values, side_by_side};
use super::course::Course;
use super::evidence::{Posterior, posterior};
use super::group::Group;
use super::habits::Habits;
use super::learn::{Active, Alternative, OfRun, Search, State, prepare, sizes_deg_h, summed};
use super::least_squares::{Likely, Prediction, along_course, by_likelihood, under_kernel, wrap};
use super::levels::Switching;
use super::process::{self, Kernel, PROCESS};
use super::recording::Recording;
use super::rhythm::{Rhythm, possible_phases};
use super::run::{Run, Whitening};

/// Kernels of a run's own process that enter its average: so many, and not below this share of the likeliest.
const MOST_KERNELS: usize = 4;
const LEAST_SHARE: f64 = 0.05;
/// Share of the kernels above which a run's course is looked for.
const LEAST_OF_COURSE: f64 = 0.02;
/// Rounds in which azimuth and what depends on it are brought into agreement.
const ROUNDS: usize = 4;
const AGREED_RAD: f64 = 1e-6;
/// Added to the normalised diagonal where functions are nearly the same.
const RIDGE: f64 = 1e-7;
/// Log density of surveyed headings that tells two models apart, and log evidence that does.
const TELLS: f64 = 1.0;
const MARGIN: f64 = 12.0;
/// Log evidence by which processes of the runs' own must be better where they miss the surveyed headings by more than a model that leaves
/// nothing but white noise.
pub const MARGIN_OF_PROCESSES: f64 = 25.0;
/// Least probability of either answer to whether a heading lies in a sector.
const LEAST_OF_SECTOR: f64 = 1e-6;
/// Beyond the learned range an effect may change by this much of its size for each half range.
const BEYOND: f64 = 2.0;

/// A group of a model.
#[derive(Clone, Debug)]
pub struct Found {
    pub group: Group,
    /// Its columns are multiplied by this.
    pub factor: f64,
    /// How many they are.
    pub width: usize,
    /// Root mean square of what it does within the training runs, °/h.
    pub size_deg_h: f64,
    /// Log odds of the model with it over the model without it.
    pub log_odds: f64,
}

/// One of the models that are averaged.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its share of the average.
    pub weight: f64,
    pub groups: Vec<Found>,
    /// Weights of all functions, group by group, and their covariance.
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Factor of it: the covariance is the product of its transpose with it.
    pub factor: DMatrix<f64>,
}

impl Model {
    /// A rhythm among the groups: its first column, their number, and its constants.
    fn rhythm(&self) -> Option<(usize, usize, Rhythm)> {
        let mut start = 0;
        for Found { group, width, .. } in &self.groups {
            if let Group::Rhythm(rhythm) = group {
                return Some((start, *width, *rhythm));
            }
            start += width;
        }
        None
    }
}

/// A model as a sum of other functions.
#[derive(Clone, Debug)]
pub struct InFunctions {
    pub coefficients: Vec<f64>,
    /// Columns of a factor of their covariance, the longest first.
    pub directions: Vec<Vec<f64>>,
    /// Root mean square of what they miss, as a share of what the model does.
    pub missed: f64,
}

/// Everything that was learned: enough to give the azimuth of a run.
#[derive(Clone, Debug)]
pub struct Learned {
    pub scales: Scales,
    pub kernels: Vec<Kernel>,
    pub shares: Vec<f64>,
    pub unit_deg_h: f64,
    /// The likeliest first.
    pub models: Vec<Model>,
    /// Added to the standard deviation of every azimuth (root of the sum of squares): what the training runs' own azimuths
    /// miss beyond theirs.
    pub excess_rad: f64,
    /// Log evidence of the likeliest model, less the penalties of its groups.
    pub worth: f64,
    /// Log-likelihood that the processes of the runs' own gain over white noise.
    pub process_gain: f64,
    /// Log density that the groups give the training runs, each as learned from the others, more than what they have without.
    pub predictive_gain: f64,
    /// Azimuths of the training runs by models without them, in the runs' order.
    pub left_out: Vec<Prediction>,
    /// Log density that they give the surveyed headings; `None` where there are none.
    score: Option<f64>,
    /// What usually happens in runs by itself.
    habits: Habits,
    /// Whitenings of the training runs.
    pub(super) whitenings: Vec<Arc<Whitening>>,
}

impl Learned {
    pub fn new(search: &Search, state: &State, alternatives: &[Alternative]) -> Self {
        let mut actives: Vec<(f64, &Active)> = vec![(0.0, &state.active)];
        actives.extend(alternatives.iter().map(|each| (each.behind.min(0.0), &each.active)));
        let contributions: Vec<Vec<OfRun>> = actives
            .par_iter()
            .map(|(_, active)| {
                (0..search.runs.len()).map(|run| search.of_run(run, active, state.of_run[run])).collect()
            })
            .collect();
        let learn = |number: usize, without: Option<usize>| {
            let prior = search.prior(actives[number].1);
            let others = contributions[number].iter().enumerate().filter(|(run, _)| Some(*run) != without);
            let (gram, right, _) = summed(others.map(|each| each.1), prior.len());
            let found = posterior(&gram, &right, &prior);
            (gram, right, found)
        };
        let gains: Vec<f64> = (0..actives.len()).map(|number| learn(number, None).2.gain).collect();
        let model = |number: usize, without: Option<usize>| {
            let (behind, active) = actives[number];
            let (gram, right, found) = learn(number, without);
            Model {
                // Less what the run that is left out says of the model.
                weight: (behind + found.gain - gains[number]).exp(),
                groups: groups(search, active, &found, (&gram, &right)),
                mean: found.mean,
                covariance: found.covariance,
                factor: found.factor,
            }
        };
        let models = |without: Option<usize>| {
            let mut models: Vec<Model> = (0..actives.len()).map(|number| model(number, without)).collect();
            let total: f64 = models.iter().map(|model| model.weight).sum();
            models.iter_mut().for_each(|model| model.weight /= total);
            models
        };
        let mut learned = Self {
            scales: search.scales.clone(),
            kernels: search.kernels.clone(),
            shares: state.shares.clone(),
            unit_deg_h: search.unit_deg_h,
            models: models(None),
            excess_rad: 0.0,
            worth: search.worth(state),
            process_gain: state.process_gain,
            predictive_gain: search.predictive_gain(state),
            left_out: Vec::new(),
            score: None,
            habits: search.habits.clone(),
            whitenings: search.runs.iter().map(|run| run.whitening.clone()).collect(),
        };
        learned.whitenings.dedup_by(|a, b| Arc::ptr_eq(a, b));
        let left_out = |learned: &Self| -> Vec<Prediction> {
            let of_run = |run: usize| learned.predict(&search.runs[run], &models(Some(run)));
            (0..search.runs.len()).into_par_iter().map(of_run).collect()
        };
        learned.left_out = left_out(&learned);
        if learned.has_courses() {
            // A course may imitate an azimuth: it is used where the training runs' azimuths speak for it.
            let mut without = Self { shares: search.shares_without_courses(state), ..learned.clone() };
            without.left_out = left_out(&without);
            if score(&search.runs, &without.left_out) > score(&search.runs, &learned.left_out) {
                learned = without;
            }
        }
        let surveyed = search.runs.iter().any(|run| run.reference.is_some());
        learned.score = surveyed.then(|| score(&search.runs, &learned.left_out));
        learned.excess_rad = excess(&search.runs, &learned.left_out);
        learned
    }

    /// Mean periods of the waves that all runs share, where they have any, seconds.
    pub fn wave_periods_s(&self) -> Vec<f64> {
        let waves = self.habits.waves.iter().filter(|_| self.has_courses());
        waves.map(|wave| 1.0 / wave.frequency_hz).collect()
    }

    /// The levels that rates go to and fro between, where they do.
    pub fn switching(&self) -> Option<Switching> {
        self.habits.switching.filter(|_| self.has_courses())
    }

    /// Whether it is to be preferred to a simpler one: by the azimuths of the training runs by models without them, where these tell and
    /// the evidence does not contradict; else by the evidence, if the azimuths do not contradict.
    pub fn is_better_than(&self, simpler: &Self) -> bool {
        let ahead = self.worth - simpler.worth;
        let Some((own, simpler_score)) = self.score.zip(simpler.score) else { return ahead > 0.0 };
        let of_azimuths = own - simpler_score;
        // What all runs have in common predicts others; processes of the runs' own may hide an azimuth.
        let hides = simpler.models.iter().all(|model| model.groups.is_empty()) && self.process_gain < PROCESS;
        let contradicts = if hides { MARGIN_OF_PROCESSES } else { MARGIN };
        (of_azimuths > TELLS && ahead > -contradicts) || (of_azimuths > -TELLS && ahead > MARGIN)
    }

    /// Azimuths of runs; `None` where one has too little in it.
    pub fn azimuths(&self, recordings: &[&Recording]) -> Vec<Option<Prediction>> {
        let (prepared, _) = prepare(recordings, &self.kernels, Some(self.unit_deg_h), &self.whitenings);
        let sizes_deg_h = sizes_deg_h(&self.kernels, self.unit_deg_h);
        prepared
            .into_par_iter()
            .map(|each| {
                let (sheet, whitening) = each?;
                let run = Run::new(sheet, None, whitening, &sizes_deg_h);
                let found = self.predict(&run, &self.models);
                Some(Prediction { sigma_rad: found.sigma_rad.hypot(self.excess_rad), ..found })
            })
            .collect()
    }

    /// The likeliest model as a sum of other functions: given for every run, function by function, by the second. `None` where no
    /// run has enough in it, or nothing was learned.
    pub fn in_functions(&self, runs: &[(&Recording, f64)], functions: &[Vec<Vec<f64>>]) -> Option<InFunctions> {
        let model = self.models.first().filter(|model| !model.groups.is_empty())?;
        let recordings: Vec<&Recording> = runs.iter().map(|each| each.0).collect();
        let (prepared, _) = prepare(&recordings, &self.kernels[..1], Some(self.unit_deg_h), &[]);
        let sizes_deg_h = sizes_deg_h(&self.kernels[..1], self.unit_deg_h);
        let (mut theirs, mut own): (Vec<DMatrix<f64>>, Vec<DMatrix<f64>>) = (Vec::new(), Vec::new());
        for ((prepared, functions), (_, azimuth_rad)) in prepared.into_iter().zip(functions).zip(runs) {
            let Some((sheet, whitening)) = prepared else { continue };
            let run = Run::new(sheet, None, whitening, &sizes_deg_h);
            let of_functions = functions.iter().map(|function| run.sheet.samples.means(function.iter().copied()));
            let mut columns = [from_columns(run.rate.len(), of_functions), self.columns(&run, model, *azimuth_rad)];
            columns.iter_mut().for_each(centre);
            let [function_columns, own_columns] = columns;
            theirs.push(function_columns);
            own.push(own_columns);
        }
        let width = theirs.first()?.ncols();
        let mut gram = DMatrix::zeros(width, width);
        let mut with = DMatrix::zeros(width, model.mean.len());
        for (theirs, own) in theirs.iter().zip(&own) {
            gram += theirs.transpose() * theirs;
            with += theirs.transpose() * own;
        }
        let sizes: Vec<f64> = gram.diagonal().iter().map(|square| square.sqrt().max(1e-150)).collect();
        let scaled = DMatrix::from_fn(width, width, |i, j| {
            gram[(i, j)] / (sizes[i] * sizes[j]) + if i == j { RIDGE } else { 0.0 }
        });
        let with = DMatrix::from_fn(width, model.mean.len(), |i, j| with[(i, j)] / sizes[i]);
        // Coefficients of functions of size 1 from the weights.
        let map = scaled.cholesky()?.solve(&with);
        let coefficients = &map * &model.mean;
        let eigen = (&map * &model.covariance * map.transpose()).symmetric_eigen();
        let mut order: Vec<usize> = (0..width).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let direction = |&i: &usize| {
            let root = eigen.eigenvalues[i].max(0.0).sqrt();
            (0..width).map(|j| root * eigen.eigenvectors[(j, i)] / sizes[j]).collect()
        };
        let coefficients: Vec<f64> = coefficients.iter().zip(&sizes).map(|(value, size)| value / size).collect();
        let (mut missed, mut all) = (0.0, 0.0);
        for (theirs, own) in theirs.iter().zip(&own) {
            let effect = own * &model.mean;
            missed += (theirs * DVector::from_column_slice(&coefficients) - &effect).norm_squared();
            all += effect.norm_squared();
        }
        Some(InFunctions {
            missed: (missed / all).sqrt(),
            coefficients,
            directions: order.iter().map(direction).collect(),
        })
    }

    /// Averaged over the models and over what remains possible in the run by each of them, as its own rows make them likely.
    fn predict(&self, run: &Run, models: &[Model]) -> Prediction {
        let course = self.course(run, models);
        let of_model = |model: &Model| {
            let log_weight = model.weight.ln();
            self.possible(run, model, course.as_ref())
                .into_iter()
                .map(move |(prior, likely)| (log_weight + prior, likely))
        };
        by_likelihood(&models.iter().flat_map(of_model).collect::<Vec<_>>()).prediction
    }

    fn has_courses(&self) -> bool {
        self.shares.last().is_some_and(|share| *share > LEAST_OF_COURSE)
    }

    /// What happens in a run by itself, where training runs have such things.
    fn course(&self, run: &Run, models: &[Model]) -> Option<Course> {
        let first = models.first().filter(|_| self.has_courses())?;
        let effect = self.effect(run, first, run.plain_azimuth_rad, None);
        Some(Course::find(&run.seen(false), &(&run.rate - effect), &self.habits))
    }

    /// By a model, for every answer to which of its sectors of headings the run is in, with the logarithm of the answer's prior probability.
    fn possible(&self, run: &Run, model: &Model, course: Option<&Course>) -> Vec<(f64, Likely)> {
        let sectors = model.groups.iter().filter_map(|found| match found.group {
            Group::Sector(sector) => Some(sector),
            _ => None,
        });
        let sectors: Vec<[f64; 2]> = sectors.collect();
        let answer = |number: usize| {
            let inside: Vec<bool> = (0..sectors.len()).map(|place| number >> place & 1 == 1).collect();
            let likely = self.predict_by(run, model, &inside, course);
            let prior = |(sector, inside): (&[f64; 2], &bool)| {
                let share = self.scales.share_of_sector(*sector, likely.prediction.azimuth_rad, run.reference);
                if *inside { share } else { 1.0 - share }.max(LEAST_OF_SECTOR).ln()
            };
            (sectors.iter().zip(&inside).map(prior).sum(), likely)
        };
        (0..1 << sectors.len()).map(answer).collect()
    }

    /// By a model, given of each of its sectors of headings whether the run is inside.
    fn predict_by(&self, run: &Run, model: &Model, inside: &[bool], course: Option<&Course>) -> Likely {
        let turns = model.groups.iter().any(|each| each.group.follows_heading());
        let beyond = self.beyond(run, model);
        let about = |azimuth_rad: f64| {
            let of_phase = |(_, columns): &(f64, DMatrix<f64>)| {
                let mean = columns * &model.mean;
                let unsure = columns * model.factor.transpose();
                let unsure = of_values(run.rate.len(), unsure.iter().chain(&beyond).copied());
                (0.0, self.predict_about(run, &mean, &unsure, course))
            };
            let columns = self.columns_inside(run, model, azimuth_rad, inside);
            let each = self.at_phases(run, model, columns, course);
            by_likelihood(&each.iter().map(of_phase).collect::<Vec<_>>())
        };
        let mut found = about(run.plain_azimuth_rad);
        let mut azimuth_rad = run.plain_azimuth_rad;
        for _ in 1..if turns { ROUNDS } else { 1 } {
            let moved = wrap(found.prediction.azimuth_rad - azimuth_rad).abs();
            if moved < AGREED_RAD {
                break;
            }
            azimuth_rad = found.prediction.azimuth_rad;
            found = about(azimuth_rad);
        }
        found
    }

    /// Given what the effects do and a factor of the covariance of what is uncertain about it: averaged over the kernels of the run's own process.
    fn predict_about(&self, run: &Run, mean: &DVector<f64>, unsure: &DMatrix<f64>, course: Option<&Course>) -> Likely {
        let residual = &run.rate - mean;
        let likelihood = run.log_likelihood(&residual, false, course);
        let weights = process::posterior(&likelihood, &self.shares);
        let mut order: Vec<usize> = (0..weights.len()).collect();
        order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
        let least = LEAST_SHARE * weights[order[0]];
        order.truncate(MOST_KERNELS);
        order.retain(|&kernel| weights[kernel] > least);
        let of_kernel = |kernel: usize| {
            let course = course.filter(|_| kernel + 1 == self.kernels.len());
            let likely = match course {
                Some(course) => along_course(run, &residual, unsure, course, likelihood[kernel]),
                None => under_kernel(run, (kernel, self.kernels[kernel].size * self.unit_deg_h), &residual, unsure),
            };
            (self.shares[kernel].ln(), likely)
        };
        by_likelihood(&order.into_iter().map(of_kernel).collect::<Vec<_>>())
    }

    /// Columns of a run at every phase that a rhythm among the groups may have in it, with the phases' probabilities, the likeliest
    /// first: by the run alone, whatever processes it may have.
    fn at_phases(
        &self,
        run: &Run,
        model: &Model,
        columns: DMatrix<f64>,
        course: Option<&Course>,
    ) -> Vec<(f64, DMatrix<f64>)> {
        let Some((start, width, rhythm)) = model.rhythm() else { return vec![(1.0, columns)] };
        let own = columns.columns(start, width).into_owned();
        let weights = model.mean.rows(start, width).into_owned();
        let without = &run.rate - &columns * &model.mean + &own * &weights;
        let log_likelihood = |phase: f64| {
            let residual = &without - &own * rhythm.turned(&weights, phase);
            process::mixture(&run.log_likelihood(&residual, false, course), &self.shares)
        };
        let at = |phase: f64| {
            let mut columns = columns.clone();
            columns.columns_mut(start, width).copy_from(&rhythm.turn(&own, phase));
            columns
        };
        possible_phases(log_likelihood).into_iter().map(|(weight, phase)| (weight, at(phase))).collect()
    }

    /// What a model does in a run, by the sample, at the likeliest phase.
    pub fn effect(&self, run: &Run, model: &Model, azimuth_rad: f64, course: Option<&Course>) -> DVector<f64> {
        let at_phases = self.at_phases(run, model, self.columns(run, model, azimuth_rad), course);
        at_phases.first().map_or_else(|| DVector::zeros(run.rate.len()), |(_, columns)| columns * &model.mean)
    }

    pub fn columns(&self, run: &Run, model: &Model, azimuth_rad: f64) -> DMatrix<f64> {
        let of_group =
            |Found { group, factor, .. }: &Found| self.scales.columns(&run.sheet, group, azimuth_rad) * *factor;
        let parts: Vec<DMatrix<f64>> = model.groups.iter().map(of_group).collect();
        side_by_side(run.rate.len(), &parts)
    }

    /// The same, given of each sector of headings whether the run is inside.
    fn columns_inside(&self, run: &Run, model: &Model, azimuth_rad: f64, inside: &[bool]) -> DMatrix<f64> {
        let mut inside = inside.iter();
        let of_group = |Found { group, factor, .. }: &Found| {
            let share = match group {
                Group::Sector(_) => inside.next().map_or(0.0, |inside| f64::from(u8::from(*inside))),
                _ => 1.0,
            };
            let everywhere = group.everywhere();
            self.scales.columns(&run.sheet, everywhere.as_ref().unwrap_or(group), azimuth_rad) * (share * factor)
        };
        let parts: Vec<DMatrix<f64>> = model.groups.iter().map(of_group).collect();
        side_by_side(run.rate.len(), &parts)
    }

    /// Columns of a factor of the covariance of what effects may do beyond the range that they were learned in.
    fn beyond(&self, run: &Run, model: &Model) -> Vec<f64> {
        let mut all = Vec::new();
        for Found { group, size_deg_h, .. } in &model.groups {
            for channel in group.channels() {
                let excess = self.scales.excess(&run.sheet, channel);
                if excess.iter().any(|value| *value != 0.0) {
                    all.extend(excess.into_iter().map(|value| BEYOND * size_deg_h * value));
                }
            }
        }
        all
    }
}

/// The active groups with what they do and what they are worth.
fn groups(
    search: &Search,
    active: &Active,
    found: &Posterior,
    (gram, right): (&DMatrix<f64>, &DVector<f64>),
) -> Vec<Found> {
    let prior = search.prior(active);
    let mut start = 0;
    active
        .iter()
        .map(|&(group, variance)| {
            let one: Active = vec![(group, variance)];
            let (mut squares, mut width) = (0.0, 0);
            for run in 0..search.runs.len() {
                let columns = search.active_columns(run, &one);
                width = columns.ncols();
                squares += (columns * found.mean.rows(start, width)).variance();
            }
            let others: Vec<usize> = (0..prior.len()).filter(|at| !(start..start + width).contains(at)).collect();
            let without = posterior(
                &gram.select_rows(&others).select_columns(&others),
                &right.select_rows(&others),
                &others.iter().map(|&at| prior[at]).collect::<Vec<_>>(),
            );
            start += width;
            Found {
                group: search.groups[group].clone(),
                factor: search.factors[group],
                width,
                size_deg_h: (squares / search.runs.len() as f64).sqrt(),
                log_odds: found.gain - without.gain,
            }
        })
        .collect()
}

/// What azimuths of training runs by models without them miss beyond their sigmas: root of mean(e² − σ²), at least 0; Student's, for
/// there are few of them.
fn excess(runs: &[Run], left_out: &[Prediction]) -> f64 {
    let beyond: Vec<f64> = runs
        .iter()
        .zip(left_out)
        .filter_map(|(run, found)| {
            let reference = run.reference?;
            let error = wrap(found.azimuth_rad - reference.azimuth_rad);
            Some(error.powi(2) - found.sigma_rad.powi(2) - reference.sigma_rad.powi(2))
        })
        .collect();
    studentised(beyond.len()) * root_of_mean(&beyond)
}

/// The root of the mean of what squares of errors are more than those of their sigmas; 0 where that is less, or nothing.
pub fn root_of_mean(beyond: &[f64]) -> f64 {
    (beyond.iter().sum::<f64>() / beyond.len().max(1) as f64).max(0.0).sqrt()
}

/// By how much a standard deviation from so many errors must be widened for ± 1.96 of it to hold 95 %: Student's t over 1.96.
pub fn studentised(number: usize) -> f64 {
    StudentsT::new(0.0, 1.0, number as f64).map_or(1.0, |t| t.inverse_cdf(0.975) / 1.959_964)
}

/// Log density of the training runs' surveyed headings by azimuths of models without them, their excess in the sigmas.
fn score(runs: &[Run], left_out: &[Prediction]) -> f64 {
    let excess_rad = excess(runs, left_out);
    let of_run = |(run, found): (&Run, &Prediction)| {
        let reference = run.reference?;
        let variance = found.sigma_rad.powi(2) + reference.sigma_rad.powi(2) + excess_rad.powi(2);
        Some(-0.5 * (wrap(found.azimuth_rad - reference.azimuth_rad).powi(2) / variance + variance.ln()))
    };
    runs.iter().zip(left_out).filter_map(of_run).sum()
}

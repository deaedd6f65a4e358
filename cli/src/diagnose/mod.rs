//! Closing the loop with measured data: residual → effect → model → errors before and after, on runs that took no part.

mod assemble;
mod base_turning;
mod block;
mod board;
mod candidate;
mod checks;
mod composition;
mod copies;
mod doubt;
mod effects;
mod estimate;
mod evidence;
mod experiment;
mod findings;
mod guard;
mod judge;
mod learn;
mod learned;
mod noise;
mod own_sinusoid;
mod problem;
mod refine;
pub mod report;
mod residual;
mod result;
mod stations;
mod statistics;
mod still;
mod text;
mod turn;
mod unexplained;
mod verdict;

pub use result::{
    BoardLack, Candidate, Diagnosis, Effect, Experiment, LeaveOneOut, MissedReference, NoiseTests, Origin, Rejected,
    RunDiagnosis, RunSeries, Spectra, Test,
};
pub use text::write;

use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use crate::campaign::{Campaign, Role};
use crate::run_data::{self, RunData};
pub use crate::run_data::{Refusal, Warning};
use block::Block;
use composition::Composition;
use learned::Learned;
use own_sinusoid::OwnSinusoid;
use problem::Problem;

/// What may be chosen.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What is declared of the instrument, and the model that it runs now. The latitude is each run's own.
    pub settings: Settings,
    /// Leave every run out in turn, however many there are.
    pub leave_one_out: bool,
}

/// What was learned from some runs, in one or two stages.
#[derive(Clone, Debug, Default)]
struct Fitted {
    /// Effects by the second.
    by_second: Learned,
    /// Where the base moves: how the accelerometers feel it, and what the dwells then show.
    by_dwell: Option<(BaseMotion, Learned)>,
    /// A sinusoidal disturbance with a phase of each run's own.
    sinusoid: Option<OwnSinusoid>,
    /// Files whose reference does not fit, with its error in degrees.
    bad_references: Vec<(String, f64)>,
    /// An index error, the same in all runs, that was taken out of them beforehand, degrees.
    turned_deg: Option<f64>,
    /// Names of what was found and must not be used, and why.
    withdrawn: Option<(Vec<String>, String)>,
}

impl Fitted {
    /// Whether the seconds show that the base moves.
    fn moves(&self) -> bool {
        self.by_second.taken.iter().any(|each| each.candidate.is_base_motion())
    }

    /// What the model is made of.
    fn learned(&self) -> &Learned {
        self.by_dwell.as_ref().map_or(&self.by_second, |(_, learned)| learned)
    }

    /// Nothing was learned that a model could hold.
    fn is_empty(&self) -> bool {
        self.by_second.taken.is_empty() && self.by_dwell.is_none() && self.sinusoid.is_none()
    }

    /// The same campaign with nothing learned.
    fn bare(&self) -> Self {
        Self {
            bad_references: self.bad_references.clone(),
            turned_deg: self.turned_deg,
            withdrawn: self.withdrawn.clone(),
            ..Self::default()
        }
    }

    /// Gives back what was learned, or what was learned last: it must not be used.
    fn withdraw(&mut self, why: String) {
        let mut names: Vec<String> = self.learned().taken.iter().map(|each| each.candidate.full_name()).collect();
        names.extend(self.sinusoid.map(|_| "sinusoid".to_owned()));
        if names.is_empty() {
            names.push("base-motion".into());
        }
        self.withdrawn = Some((names, why));
        match &mut self.by_dwell {
            // What was found beside the base's motion goes first.
            Some((_, learned)) if !learned.taken.is_empty() => learned.give_back(),
            _ => {
                self.by_second.give_back();
                self.by_dwell = None;
                self.sinusoid = None;
            }
        }
    }

    /// Period of a sinusoidal disturbance with a phase of each run's own, seconds.
    fn sinusoid_period_s(&self) -> Option<f64> {
        self.sinusoid.map(|own| own.period_s)
    }

    /// The model below the learned effects.
    fn base(&self, base: &ErrorModel) -> ErrorModel {
        let mut model = base.clone();
        if let Some((sensing, _)) = self.by_dwell {
            model.base_motion = Some(sensing);
        }
        if let Some(own) = self.sinusoid {
            model.sinusoid = Some(own.sinusoid());
        }
        model
    }
}

/// Diagnoses a campaign.
pub fn diagnose(campaign: &Campaign, options: &Options) -> Result<Diagnosis, Refusal> {
    let (mut runs, mut warnings) = run_data::read(campaign, &options.settings)?;
    checks::leave_out_dead(&mut runs, &mut warnings);
    let still = still::is_still(&runs);
    if still {
        runs = still::halves(runs);
    } else {
        checks::refuse(&runs)?;
    }
    let constant = checks::constant_channels(&runs);
    checks::warn(&runs, &constant, still, &mut warnings);
    let base = options.settings.model.clone().unwrap_or_default();
    copies::leave_out(&mut runs, &|name| base.channels().iter().any(|each| each.as_str() == name), &mut warnings);
    let as_recorded: Vec<_> = runs.iter().map(|run| run.before).collect();
    let turned_deg = turn::common_deg(&runs);
    if let Some(turned_deg) = turned_deg {
        runs.par_iter_mut().for_each(|run| turn::take_out(run, turned_deg, &base));
    }
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let found = Composition::learn(&fit, &base);
    let wrong = found.as_ref().map_or(Vec::new(), Composition::wrong_references);
    let wrong: Vec<String> = wrong.into_iter().map(|each| each.file).collect();
    let mut fitted = Fitted { turned_deg, ..fit_training_runs(&fit, &base, &constant, &wrong) };
    checks::refuse_latitude(&runs, fitted.learned(), &fitted.base(&base))?;
    while !fitted.is_empty()
        && let Some(why) = guard::veto(&runs, &fitted, &base, &guard::left_out(&runs, &fitted, &base))
    {
        fitted.withdraw(why);
    }
    let material = assemble::Material {
        campaign,
        runs: &runs,
        as_recorded: &as_recorded,
        constant: &constant,
        base: &base,
        still,
    };
    assemble::diagnosis(&material, &fitted, found.as_ref(), options, warnings)
}

/// Learns from runs, whatever their role: the caller chooses them. `wrong`: files whose references are known to be wrong.
fn fit_training_runs(runs: &[&RunData], base: &ErrorModel, constant: &[String], wrong: &[String]) -> Fitted {
    let error_deg = |run: &RunData| Some(wrap_180_deg(run.before?.azimuth_deg - run.reference_deg?));
    let bad = runs.iter().filter(|run| wrong.contains(&run.file));
    let bad_references = bad.map(|run| (run.file.clone(), error_deg(run).unwrap_or_default())).collect();
    let mut fitted = Fitted { bad_references, ..Fitted::default() };
    let candidates = effects::all(runs, constant);
    let mut rejected_references: Vec<String> = wrong.to_vec();
    for _ in 0..3 {
        let mut problem = Problem::new(blocks_of(runs, &rejected_references, None));
        // Beforehand a wrong reference may hide behind what the effects do; afterwards it stands alone.
        let none = vec![0.0; problem.rows()];
        if reject_references(&problem, &none, &mut rejected_references, &mut fitted) {
            continue;
        }
        fitted.by_second = learn::learn(blocks_of(runs, &rejected_references, None), &candidates);
        problem.linearise(&fitted.by_second.taken);
        let effects = problem.effects(&fitted.by_second.taken);
        if fitted.moves() || !reject_references(&problem, &effects, &mut rejected_references, &mut fitted) {
            break;
        }
    }
    if fitted.moves() {
        fitted.by_dwell = judge::way_of_base_motion(runs, base)
            .map(|sensing| (sensing, fit_dwells(runs, base, constant, &rejected_references, sensing)));
        return fitted;
    }
    if let Some(own) = OwnSinusoid::find(runs, &fitted.by_second) {
        let beside = learn::learn(blocks_of(runs, &rejected_references, Some(own.period_s)), &candidates);
        if own_sinusoid::explains(own.period_s, &fitted.by_second, &beside) {
            fitted.by_second = beside;
            fitted.sinusoid = Some(own);
        }
    }
    if learn::is_structure(fitted.by_second.left, fitted.by_second.left_freedom) {
        fitted.by_second = learn::learn_without_spurious_terms(
            blocks_of(runs, &rejected_references, fitted.sinusoid_period_s()),
            &candidates,
        );
    }
    fitted
}

/// Looks for a reference that does not fit the others; whether one was found.
fn reject_references(
    problem: &Problem,
    effects: &[f64],
    rejected_references: &mut Vec<String>,
    fitted: &mut Fitted,
) -> bool {
    match checks::outlying_reference(problem, effects) {
        Some((place, error_deg)) => {
            let file = problem.blocks[place].run.file.clone();
            fitted.bad_references.push((file.clone(), error_deg));
            rejected_references.push(file);
            true
        }
        None => false,
    }
}

fn blocks_of<'a>(
    runs: &[&'a RunData],
    rejected_references: &[String],
    sinusoid_period_s: Option<f64>,
) -> Vec<Block<'a>> {
    runs.iter().filter_map(|run| Block::new(run, !rejected_references.contains(&run.file), sinusoid_period_s)).collect()
}

/// On a moving base: the dwells with the motion taken out, and what they show.
fn fit_dwells(
    runs: &[&RunData],
    base: &ErrorModel,
    constant: &[String],
    rejected_references: &[String],
    sensing: BaseMotion,
) -> Learned {
    let model = ErrorModel { base_motion: Some(sensing), ..base.clone() };
    let dwells: Vec<RunData> = runs.iter().filter_map(|run| judge::dwells_of(run, &model)).collect();
    let dwells: Vec<&RunData> = dwells.iter().collect();
    // What changes inside a dwell, and what a dwell's own tilt does, cannot be seen any more.
    let candidates: Vec<_> = effects::all(&dwells, constant)
        .into_iter()
        .filter(|each| {
            let tilt = matches!(each.channel.as_deref(), Some("ax_g" | "ay_g"));
            !tilt && each.grid.is_empty() && !each.is_base_motion()
        })
        .collect();
    let learned = learn::learn(blocks_of(&dwells, rejected_references, None), &candidates);
    // What takes a run's azimuth away, which the run has without it, is no effect of the gyro.
    let loses = |run: &&RunData| {
        let with_effects = learned.model(&model).ok().and_then(|with_effects| run.solve(&with_effects));
        run.solve(&model).is_some() && with_effects.is_none()
    };
    if runs.iter().any(loses) { learn::learn(blocks_of(&dwells, rejected_references, None), &[]) } else { learned }
}

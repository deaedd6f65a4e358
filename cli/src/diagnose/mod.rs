//! Closing the loop with measured data: residual → effect → model → errors before and after, on runs that took no part.

mod assemble;
mod base_turning;
mod block;
mod candidate;
mod checks;
mod data;
mod deploy;
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
mod line;
mod noise;
mod open;
mod problem;
mod refine;
pub mod report;
mod residual;
mod result;
mod statistics;
mod text;
mod turn;
mod unexplained;
mod verdict;

pub use result::{
    Candidate, Diagnosis, Effect, Experiment, LeaveOneOut, NoiseTests, Origin, Rejected, RunDiagnosis, RunSeries,
    Spectra, Test, Warning,
};
pub use text::write;

use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::settings::Settings;
use rayon::prelude::*;

use crate::campaign::{Campaign, Role};
use crate::file_error::FileError;
use block::Block;
use data::RunData;
use learned::Learned;
use line::OwnLine;
use problem::Problem;

/// What may be chosen.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What is declared of the instrument, and the model that it runs now. The latitude is each run's own.
    pub settings: Settings,
    /// Leave every run out in turn, however many there are.
    pub leave_one_out: bool,
}

/// Why a campaign cannot be diagnosed at all.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    #[error(transparent)]
    File(#[from] FileError),
    /// The campaign as a whole does not allow it.
    #[error("{0}")]
    Campaign(String),
    /// A run makes no sense; `line` counts the header as 1.
    #[error("{run}{}: {problem}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Run { run: String, line: Option<u64>, problem: String },
}

/// What was learned from some runs, in one or two stages.
#[derive(Clone, Debug, Default)]
struct Lesson {
    /// Effects by the second.
    by_second: Learned,
    /// Where the base moves: how the accelerometers feel it, and what the stays then show.
    by_stay: Option<(BaseMotion, Learned)>,
    /// A line with a phase of each run's own.
    line: Option<OwnLine>,
    /// Files whose reference does not fit, with its error in degrees.
    bad_references: Vec<(String, f64)>,
    /// An index error, the same in all runs, that was taken out of them beforehand, degrees.
    turned_deg: Option<f64>,
    /// Names of what was found and must not be used, and why.
    withdrawn: Option<(Vec<String>, String)>,
}

impl Lesson {
    /// Whether the seconds show that the base moves.
    fn moves(&self) -> bool {
        self.by_second.taken.iter().any(|each| each.candidate.is_base_motion())
    }

    /// What the model is made of.
    fn learned(&self) -> &Learned {
        self.by_stay.as_ref().map_or(&self.by_second, |(_, learned)| learned)
    }

    /// Nothing was learned that a model could hold.
    fn is_empty(&self) -> bool {
        self.by_second.taken.is_empty() && self.by_stay.is_none() && self.line.is_none()
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
        names.extend(self.line.map(|_| "line".to_owned()));
        if names.is_empty() {
            names.push("base-motion".into());
        }
        self.withdrawn = Some((names, why));
        match &mut self.by_stay {
            // What was found beside the base's motion goes first.
            Some((_, learned)) if !learned.taken.is_empty() => learned.give_back(),
            _ => {
                self.by_second.give_back();
                self.by_stay = None;
                self.line = None;
            }
        }
    }

    /// Period of a line with a phase of each run's own, seconds.
    fn line_s(&self) -> Option<f64> {
        self.line.map(|line| line.period_s)
    }

    /// The model below the learned effects.
    fn base(&self, base: &ErrorModel) -> ErrorModel {
        let mut model = base.clone();
        if let Some((sensing, _)) = self.by_stay {
            model.base_motion = Some(sensing);
        }
        if let Some(line) = self.line {
            model.sinusoid = Some(line.sinusoid());
        }
        model
    }
}

/// Diagnoses a campaign.
pub fn diagnose(campaign: &Campaign, options: &Options) -> Result<Diagnosis, Refusal> {
    let (mut runs, mut warnings) = data::read(campaign, options)?;
    checks::refuse(&runs)?;
    let constant = checks::constant_channels(&runs);
    checks::warn(&runs, &constant, &mut warnings);
    let base = options.settings.model.clone().unwrap_or_default();
    let as_recorded: Vec<_> = runs.iter().map(|run| run.before).collect();
    let turned_deg = turn::common_deg(&runs);
    if let Some(turned_deg) = turned_deg {
        runs.par_iter_mut().for_each(|run| turn::take_out(run, turned_deg, &base));
    }
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let mut lesson = Lesson { turned_deg, ..study(&fit, &base, &constant) };
    checks::refuse_latitude(&runs, lesson.learned(), &lesson.base(&base))?;
    while !lesson.is_empty()
        && let Some(why) = guard::veto(&runs, &lesson, &base, &guard::left_out(&runs, &lesson, &base))
    {
        lesson.withdraw(why);
    }
    assemble::diagnosis(campaign, &runs, &as_recorded, &constant, &lesson, options, warnings)
}

/// Learns from runs, whatever their role: the caller chooses them.
fn study(runs: &[&RunData], base: &ErrorModel, constant: &[String]) -> Lesson {
    let mut lesson = Lesson::default();
    let candidates = effects::all(runs, constant);
    let mut distrusted: Vec<String> = Vec::new();
    for _ in 0..3 {
        let mut problem = Problem::new(blocks_of(runs, &distrusted, None));
        // Beforehand a wrong reference may hide behind what the effects do; afterwards it stands alone.
        let none = vec![0.0; problem.rows()];
        if distrust(&problem, &none, &mut distrusted, &mut lesson) {
            continue;
        }
        lesson.by_second = learn::learn(blocks_of(runs, &distrusted, None), &candidates);
        problem.linearise(&lesson.by_second.taken);
        let effects = problem.effects(&lesson.by_second.taken);
        if lesson.moves() || !distrust(&problem, &effects, &mut distrusted, &mut lesson) {
            break;
        }
    }
    if lesson.moves() {
        lesson.by_stay = judge::way_of_base_motion(runs, base)
            .map(|sensing| (sensing, study_stays(runs, base, constant, &distrusted, sensing)));
        return lesson;
    }
    if let Some(line) = OwnLine::find(runs, &lesson.by_second) {
        let beside = learn::learn(blocks_of(runs, &distrusted, Some(line.period_s)), &candidates);
        if line::explains(line.period_s, &lesson.by_second, &beside) {
            lesson.by_second = beside;
            lesson.line = Some(line);
        }
    }
    if learn::is_structure(lesson.by_second.left, lesson.by_second.left_freedom) {
        lesson.by_second = learn::learn_without_shadows(blocks_of(runs, &distrusted, lesson.line_s()), &candidates);
    }
    lesson
}

/// Looks for a reference that does not fit the others; whether one was found.
fn distrust(problem: &Problem, effects: &[f64], distrusted: &mut Vec<String>, lesson: &mut Lesson) -> bool {
    match checks::outlying_reference(problem, effects) {
        Some((place, error_deg)) => {
            let file = problem.blocks[place].run.file.clone();
            lesson.bad_references.push((file.clone(), error_deg));
            distrusted.push(file);
            true
        }
        None => false,
    }
}

fn blocks_of<'a>(runs: &[&'a RunData], distrusted: &[String], line_s: Option<f64>) -> Vec<Block<'a>> {
    runs.iter().filter_map(|run| Block::new(run, !distrusted.contains(&run.file), line_s)).collect()
}

/// On a moving base: the stays with the motion taken out, and what they show.
fn study_stays(
    runs: &[&RunData],
    base: &ErrorModel,
    constant: &[String],
    distrusted: &[String],
    sensing: BaseMotion,
) -> Learned {
    let model = ErrorModel { base_motion: Some(sensing), ..base.clone() };
    let stays: Vec<RunData> = runs.iter().filter_map(|run| judge::stays_of(run, &model)).collect();
    let stays: Vec<&RunData> = stays.iter().collect();
    // What changes inside a stay, and what a stay's own tilt does, cannot be seen any more.
    let candidates: Vec<_> = effects::all(&stays, constant)
        .into_iter()
        .filter(|each| {
            let tilt = matches!(each.channel.as_deref(), Some("ax_g" | "ay_g"));
            !tilt && each.grid.is_empty() && !each.is_base_motion()
        })
        .collect();
    let learned = learn::learn(blocks_of(&stays, distrusted, None), &candidates);
    // What takes a run's azimuth away, which the run has without it, is no effect of the gyro.
    let loses = |run: &&RunData| {
        let with_effects = learned.model(&model).ok().and_then(|with_effects| run.solve(&with_effects));
        run.solve(&model).is_some() && with_effects.is_none()
    };
    if runs.iter().any(loses) { learn::learn(blocks_of(&stays, distrusted, None), &[]) } else { learned }
}

//! Closing the loop with measured data: residual → effect → model → errors before and after, on runs that took no part.
//!
//! [`crate::run_data`] reads → `checks` doubt → `found` learns → `validate` judges by runs that took no part → `assemble` says.

mod advice;
mod assemble;
mod board;
mod checks;
mod copies;
mod doubt;
mod experiment;
mod findings;
mod found;
mod guard;
mod missed;
mod moving;
mod names;
mod noise;
mod problem;
mod readings;
mod residual;
mod result;
mod run_residual;
mod stations;
pub mod statistics;
mod still;
mod text;
mod turn;
mod unexplained;
mod validate;
mod verdict;
pub mod warnings;

pub use names::full_name as effect_name;
pub use result::{
    Ask, BoardLack, Candidate, Diagnosis, Effect, Experiment, FamilyEffect, InFamily, LeaveOneOut, MissedReference,
    NoiseTests, Origin, Rejected, RunDiagnosis, RunSeries, Spectra, Test,
};
pub use statistics::median;
pub use text::write;

use learn::{Family, Learned, Run};
use north_finder::effects::ErrorModel;
use north_finder::event::Fix;
use north_finder::settings::Settings;
use rayon::prelude::*;

use crate::campaign::{Campaign, Role};
use crate::run_data::{self, RunData};
pub use crate::run_data::{Refusal, Warning};
use found::Found;
use turn::Turn;

/// What may be chosen.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What is declared of the instrument, and the model that it runs now. The latitude is each run's own.
    pub settings: Settings,
    /// Leave every run out in turn, however many there are.
    pub leave_one_out: bool,
    /// What the instruments of its type have in common; nothing where that is not known.
    pub family: Family,
}

/// The runs of a campaign, put in order before anything is learned from them.
#[derive(Clone)]
struct Prepared {
    runs: Vec<RunData>,
    warnings: Vec<Warning>,
    /// There are still recordings only.
    still: bool,
    /// The model that the runs were made with.
    base: ErrorModel,
    as_recorded: Vec<Option<Fix>>,
    /// An index error, the same in all runs, that was taken out of them.
    turn: Option<Turn>,
}

impl Prepared {
    /// Those that may be learned from.
    fn fit(&self) -> Vec<&RunData> {
        self.runs.iter().filter(|run| run.role == Role::Fit).collect()
    }

    /// What those teach.
    fn teach(&self, family: &Family) -> Option<Found> {
        Found::learn(&self.fit(), &self.base, family, None)
    }

    /// The same with a turn taken out.
    fn without_turn(mut self, turn: Turn) -> Self {
        self.runs.par_iter_mut().for_each(|run| turn.take_out(run, &self.base));
        self.turn = Some(turn);
        self
    }
}

/// What the runs of a campaign teach. Where all their azimuths are off by about the same, that is taken out first, unless effects that turn them about alike are likelier: what is
/// taken out for nothing has to be put back by another effect.
fn taught(prepared: Prepared, family: &Family) -> (Prepared, Option<Found>) {
    let Some(turn) = turn::common(&prepared.runs) else {
        let found = prepared.teach(family);
        return (prepared, found);
    };
    let turned = prepared.clone().without_turn(turn);
    let of_turned = turned.teach(family);
    if let Some(with_turn) = of_turned.as_ref().filter(|found| !found.is_nothing())
        && let Some(as_recorded) = prepared.teach(family)
        && as_recorded.learned.worth() > with_turn.learned.worth() - turn.cost(&with_turn.learned)
    {
        return (prepared, Some(as_recorded));
    }
    (turned, of_turned)
}

/// Diagnoses a campaign: a function of the campaign's files and the options only.
pub fn diagnose(campaign: &Campaign, options: &Options) -> Result<Diagnosis, Refusal> {
    let (prepared, found) = taught(prepared(campaign, options)?, &options.family);
    let Prepared { runs, mut warnings, still, base, as_recorded, turn } = prepared;
    checks::refuse_latitude(&runs, found.as_ref(), &base, &mut warnings)?;
    let material = assemble::Material { campaign, runs: &runs, as_recorded: &as_recorded, turn, base: &base, still };
    Ok(assemble::diagnosis(&material, found, options, warnings))
}

/// What the runs of a campaign teach that may be learned from; not judged by runs that took no part, so that it takes a fifth of the time of a
/// diagnosis.
pub fn learned(campaign: &Campaign, options: &Options) -> Result<Option<Learned>, Refusal> {
    let (_, found) = taught(prepared(campaign, options)?, &options.family);
    Ok(found.map(|found| found.learned))
}

/// The runs of a campaign that may be learned from, as the search sees them.
pub fn searched(campaign: &Campaign, options: &Options) -> Result<Vec<Run>, Refusal> {
    let mut prepared = prepared(campaign, options)?;
    if let Some(turn) = turn::common(&prepared.runs) {
        prepared = prepared.without_turn(turn);
    }
    Ok(found::searched(&prepared.fit(), &prepared.base).map_or(Vec::new(), |searched| searched.runs))
}

fn prepared(campaign: &Campaign, options: &Options) -> Result<Prepared, Refusal> {
    let (mut runs, mut warnings) = run_data::read(campaign, &options.settings)?;
    checks::leave_out_dead(&mut runs, &mut warnings);
    checks::warn_of_overlaps(&runs, campaign, &mut warnings);
    let mut base = options.settings.model.clone().unwrap_or_default();
    readings::hold(&mut runs, &mut base, &mut warnings);
    let still = still::is_still(&runs);
    if still {
        runs = still::halves(runs);
    } else {
        checks::refuse(&runs)?;
        checks::refuse_other_sign(&runs)?;
    }
    let constant = checks::constant_channels(&runs);
    checks::warn_of_missing_channels(&runs, &mut warnings);
    checks::warn(&runs, &constant, still, &mut warnings);
    copies::leave_out(&mut runs, &|name| base.channels().iter().any(|each| each.as_str() == name), &mut warnings);
    let as_recorded: Vec<_> = runs.iter().map(|run| run.before).collect();
    Ok(Prepared { runs, warnings, still, base, as_recorded, turn: None })
}

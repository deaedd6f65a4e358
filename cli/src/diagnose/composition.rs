//! What the search over products of factors found, beside the named effects: one of the two is used, by their evidence on the same runs.

use std::collections::BTreeMap;

use north_finder::effects::doubt::{Doubt, Process};
use north_finder::effects::{ErrorModel, effect};
use north_finder::event::Fix;
use rayon::prelude::*;

use super::block::Block;
use super::learned::Taken;
use super::problem::Problem;
use super::stations::misses_deg;
use super::statistics::rms;
use super::{Effect, doubt, guard};
use crate::campaign::Role;
use crate::learn::{self, Blunder, Learned, Run};
use crate::run_data::RunData;

/// Folds of the validation that learns again: each leaves a quarter of the runs out.
pub const FOLDS: usize = 4;
/// Fewest runs that anything is learned from, where they have azimuths.
const LEAST_RUNS: usize = 3;
/// What the search over products finds stands in the place of named effects where it is more likely by this, nats: odds of twenty to one.
const MARGIN: f64 = 3.0;
/// Named candidates, each one of so many, with constants of so many values.
const NAMED: f64 = 60.0;
const VALUES: f64 = 8.0;

/// What the search over products of factors found.
pub struct Composition {
    learned: Learned,
    /// Files of the runs that were learned from, in the order of the search.
    files: Vec<String>,
    /// What the firmware runs.
    pub model: ErrorModel,
}

/// What is wrong with a reference, by the files of the runs.
pub struct WrongReference {
    pub file: String,
    pub exchanged_with: Option<String>,
}

impl Composition {
    /// From runs of any role: the caller chooses them. `None` where there are too few to learn from, or no model can hold what was found.
    pub fn learn(runs: &[&RunData], base: &ErrorModel) -> Option<Self> {
        let readable: Vec<(String, Run)> =
            runs.par_iter().filter_map(|run| Some((run.file.clone(), Run::new(run, runs.len())?))).collect();
        let (files, of_search): (Vec<String>, Vec<Run>) = readable.into_iter().unzip();
        if of_search.len() < LEAST_RUNS && !runs.iter().all(|run| run.at_one_position()) || of_search.is_empty() {
            return None;
        }
        let learned = learn::learn(of_search);
        let model = learned.posterior.written(base, &learned.runs)?;
        Some(Self { learned, files, model })
    }

    /// References that are wrong, by what the runs say of each other.
    pub fn wrong_references(&self) -> Vec<WrongReference> {
        let file = |i: usize| self.files[i].clone();
        let of = |blunder: &Blunder| match *blunder {
            Blunder::Wrong(i) => vec![WrongReference { file: file(i), exchanged_with: None }],
            Blunder::Exchanged(i, j) => vec![
                WrongReference { file: file(i), exchanged_with: Some(file(j)) },
                WrongReference { file: file(j), exchanged_with: Some(file(i)) },
            ],
        };
        self.learned.blunders.iter().flat_map(of).collect()
    }

    pub fn process(&self) -> Option<Process> {
        self.learned.posterior.process
    }

    /// Whether it (it may be that there is nothing) is to stand in the place of these named effects, and the process that suits these best.
    pub fn against(&self, runs: &[&RunData], taken: &[Taken]) -> (bool, Option<Process>) {
        let groups = self.groups(runs, taken);
        let Some((evidence, process)) = learn::evidence_of(&self.learned.runs, &groups) else { return (false, None) };
        let constants = |taken: &Taken| if taken.candidate.grid.is_empty() { 0.0 } else { VALUES.ln() };
        let cost: f64 = taken.iter().map(|each| NAMED.ln() + constants(each)).sum();
        (self.learned.score > evidence - cost + MARGIN, process)
    }

    /// Columns of the named effects by the rows of the search, each of a root mean square of one.
    fn groups(&self, runs: &[&RunData], taken: &[Taken]) -> Vec<Vec<Vec<f64>>> {
        let runs: Vec<&&RunData> =
            self.files.iter().filter_map(|file| runs.iter().find(|run| run.file == *file)).collect();
        let blocks: Vec<Option<Block>> = runs.iter().map(|run| Block::new(run, true, None)).collect();
        let mut problem = Problem::new(blocks.into_iter().flatten().collect());
        problem.linearise(taken);
        let of_effect = |taken: &Taken| {
            let mut columns = vec![Vec::new(); taken.coefficients.len()];
            for (run, own) in runs.iter().zip(&self.learned.runs) {
                let block = problem.blocks.iter().find(|block| block.run.file == run.file);
                let found = block
                    .map(|block| taken.candidate.columns(run, taken.constant, &block.smooth_deg_h, own.azimuth_deg));
                for (place, column) in columns.iter_mut().enumerate() {
                    match found.as_ref().and_then(|found| found.get(place)) {
                        Some(by_second) => column.extend(own.by_row(by_second)),
                        None => column.extend(vec![0.0; own.rows()]),
                    }
                }
            }
            columns.iter_mut().for_each(|column| {
                let size = rms(column).max(f64::MIN_POSITIVE);
                column.iter_mut().for_each(|value| *value /= size);
            });
            columns
        };
        taken.iter().map(of_effect).collect()
    }

    /// What it found, in words.
    pub fn effects(&self) -> Vec<Effect> {
        let posterior = &self.learned.posterior;
        let best = posterior.alternatives.first();
        let probability = |effect: &effect::Effect| -> f64 {
            let with = posterior.alternatives.iter().filter(|each| each.effects.iter().any(|own| alike(own, effect)));
            with.map(|each| each.probability).sum()
        };
        let log_odds = self.learned.score - self.learned.score_without;
        let say = |effect: &effect::Effect| {
            let channels: Vec<String> = effect.channels().map(|name| name.as_str().to_owned()).collect();
            let instead = posterior.alternatives.iter().skip(1).filter_map(|other| {
                let others: Vec<String> = other
                    .effects
                    .iter()
                    .filter(|each| !best.is_some_and(|best| best.effects.contains(each)))
                    .map(ToString::to_string)
                    .collect();
                (!others.is_empty() && !other.effects.contains(effect)).then(|| others.join(" and "))
            });
            let mut ambiguous_with: Vec<String> = Vec::new();
            instead.for_each(|name| {
                if !ambiguous_with.contains(&name) {
                    ambiguous_with.push(name);
                }
            });
            Effect {
                name: effect.to_string(),
                kind: match effect.port {
                    effect::Port::Rate => "bias",
                    effect::Port::Scale => "scale",
                    effect::Port::Index => "index",
                    effect::Port::Forward | effect::Port::Left => "level",
                },
                channel: match channels.as_slice() {
                    [one] => Some(one.clone()),
                    _ => None,
                },
                channels,
                parameters: BTreeMap::from([("rms_deg_h".to_owned(), self.size_deg_h(effect))]),
                sigma: BTreeMap::new(),
                p_value: 1.0 / (1.0 + log_odds.exp()),
                ambiguous_with,
                evidence: format!(
                    "log odds {log_odds:.0} of the model over none; it is in models of together {:.2} of the probability",
                    probability(effect)
                ),
                board: effect.channels().all(|name| name.is_on_board(true)),
            }
        };
        best.map_or(Vec::new(), |best| best.effects.iter().map(|effect| say(posterior.with_weights(effect))).collect())
    }

    /// Root mean square of what an effect adds to the rates of the runs, each run's mean taken out, °/h.
    fn size_deg_h(&self, effect: &effect::Effect) -> f64 {
        let of_run = |run: &Run| {
            let columns = run.columns_of(effect);
            let sum =
                |row: usize| columns.iter().zip(&effect.weights).map(|(c, w)| c[row] * f64::from(*w)).sum::<f64>();
            let values: Vec<f64> = (0..run.rows()).map(sum).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.into_iter().map(|value| value - mean).collect::<Vec<f64>>()
        };
        rms(&self.learned.runs.iter().flat_map(of_run).collect::<Vec<f64>>())
    }

    /// What of the process remains, in words.
    pub fn unexplained(&self) -> Vec<String> {
        self.process().map(in_words).into_iter().collect()
    }
}

/// A process in words.
pub fn in_words(process: Process) -> String {
    format!(
        "a process of every run's own that no channel tells, typically {:.4} deg/h over {:.0} s; sigma covers it",
        process.sigma_deg_h, process.time_s
    )
}

fn alike(a: &effect::Effect, b: &effect::Effect) -> bool {
    a.port == b.port && a.factors == b.factors
}

/// These runs, each by what a search over the others of them found, in so many parts at most: azimuth and sigma by the firmware's replay, in the order
/// of all runs; `None` where there is no azimuth. A search that finds nothing leaves the runs as they were.
pub fn by_the_others(runs: &[RunData], places: &[usize], folds: usize, base: &ErrorModel) -> Vec<Option<Fix>> {
    let folds = folds.min(places.len());
    let mut fixes = vec![None; runs.len()];
    for fold in 0..folds {
        let inside = |place: usize| place % folds == fold;
        let training: Vec<&RunData> =
            places.iter().enumerate().filter(|(place, _)| !inside(*place)).map(|(_, &i)| &runs[i]).collect();
        let model = Composition::learn(&training, base).map_or_else(|| base.clone(), |found| found.model);
        let model = doubt::shown(model, runs);
        for (_, &i) in places.iter().enumerate().filter(|(place, _)| inside(*place)) {
            fixes[i] = runs[i].replay(&model, &mut |_| ()).ok();
        }
    }
    fixes
}

/// Why what was found must not be used, if there is a reason: it costs azimuths, training runs that took no part in learning it miss their
/// references by more with it, or it makes the Earth's rate impossible.
pub fn veto(runs: &[RunData], found: &ErrorModel, left_out: &[Option<Fix>], wrong: &[String]) -> Option<String> {
    // What is uncertain of it takes no azimuth away, but widens sigma.
    let found = ErrorModel { doubt: Doubt::default(), ..found.clone() };
    let with: Vec<Option<Fix>> = runs.par_iter().map(|run| run.replay(&found, &mut |_| ()).ok()).collect();
    if let Some(why) = guard::lost_azimuth(runs, &with, left_out) {
        return Some(why);
    }
    let azimuth = |fix: Option<Fix>| Some(fix?.azimuth_deg);
    let before: Vec<Option<f64>> = runs.iter().map(|run| azimuth(run.before)).collect();
    let after: Vec<Option<f64>> = left_out.iter().copied().map(azimuth).collect();
    let misses = misses_deg(runs, &before).into_iter().zip(misses_deg(runs, &after));
    let pairs: Vec<(f64, f64)> = runs
        .iter()
        .zip(misses)
        .filter(|(run, _)| run.role == Role::Fit && !wrong.contains(&run.file))
        .filter_map(|(_, (before, after))| before.zip(after))
        .collect();
    guard::made_worse(&pairs).or_else(|| {
        let share = |(run, fix): (&RunData, &Option<Fix>)| Some((*fix)?.amplitude_deg_h / run.earth.north_deg_h);
        let before: Vec<f64> = runs.iter().filter_map(|run| share((run, &run.before))).collect();
        let after: Vec<f64> = runs.iter().zip(&with).filter_map(share).collect();
        guard::impossible_amplitude(&before, &after)
    })
}

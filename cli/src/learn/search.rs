//! The choice of the model: proposals by a score, decisions by the evidence.

use std::sync::Arc;

use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use rayon::prelude::*;

use super::bank::Bank;
use super::grammar::{Grammar, neighbours};
use super::model::Model;
use super::problem::Term;
use super::references::{Blunder, likeliest};
use super::rows::Run;

/// A campaign without any effect must name one in at most this share of campaigns: by Markov's inequality the evidence for an effect, times the
/// probability of its form, exceeds the evidence for none by more than one over this share in at most this share of them.
const FALSE_DISCOVERIES: f64 = 1.0 / 200.0;
/// The same for a further effect beside one that was found.
const FURTHER_FALSE_DISCOVERIES: f64 = 1.0 / 20.0;
/// Most effects of a model: what its file and a board have room for.
pub const MOST_EFFECTS: usize = 12;
/// Most that an error of the index or of the level may be, root mean square, degrees and g: the equations are linear in it, and leave out e²/2 of the
/// rate, 0.4 % at 5°. What is larger is another effect, which this one stands for.
const MOST_INDEX_DEG: f64 = 5.0;
const MOST_LEVEL_G: f64 = 0.087;
/// Most that the scale factor may change by, root mean square.
const MOST_SCALE: f64 = 0.2;
/// Proposals whose exact evidence is computed, and those that are tuned.
const SHORTLIST: usize = 40;
const FINALISTS: usize = 2;
/// What tuning may add to the gain of a proposal whose constants lie at most half a step of the bank's from the best, nats; below it a proposal is dropped.
const HOPE: f64 = 3.0;
/// Neighbours of a form whose exact evidence is computed, and most changes of form in a row.
const NEAREST: usize = 16;
const CLIMBS: usize = 2;

/// What a search begins with.
#[derive(Clone, Debug, Default)]
pub struct Start {
    pub effects: Vec<Effect>,
    pub process: Option<Process>,
}

/// The search's tools.
pub struct Search<'a> {
    pub runs: &'a [Run],
    pub grammar: Grammar,
    gates: Vec<Factor>,
    bank: Bank,
}

impl<'a> Search<'a> {
    pub fn new(runs: &'a [Run]) -> Self {
        let grammar = Grammar::new(runs);
        let factors = grammar.factors(runs);
        let gates = grammar.gates(&factors);
        let bank = Bank::new(runs, &grammar, &factors, &gates);
        Self { runs, grammar, gates, bank }
    }

    /// The model of the greatest score, if the runs allow one: from what was found in runs of which one reference was another, or from nothing.
    pub fn best(&self, start: &Start) -> Option<Model<'a>> {
        let bare = Model::new(self.runs, None, &[])?;
        let terms: Vec<Term> = start.effects.iter().map(|effect| self.term(&bare, effect)).collect();
        let mut model = self.pruned(Model::new(self.runs, start.process, &terms)?.with_likeliest_process());
        while model.terms.len() < MOST_EFFECTS {
            let asked = if model.terms.is_empty() { FALSE_DISCOVERIES } else { FURTHER_FALSE_DISCOVERIES };
            let Some(wider) = self.widened(&model) else { break };
            if wider.score(&self.grammar) - model.score(&self.grammar) <= -asked.ln() {
                break;
            }
            model = self.pruned(wider);
        }
        Some(if model.effects() == start.effects { model } else { self.revised(model) })
    }

    /// A model, and those that differ from it by one effect: the best first.
    pub fn with_rivals(&self, best: Model<'a>) -> Vec<Model<'a>> {
        let mut models = self.rivals(&best);
        models.push(best);
        models.sort_by(|a, b| b.score(&self.grammar).total_cmp(&a.score(&self.grammar)));
        models
    }

    /// References that may be wrong: beside a model, where effects hide none, and without any, where an effect may stand for one.
    pub fn suspects(&self, model: &Model<'a>) -> Vec<Blunder> {
        let bare = Model::new(self.runs, None, &[]).map(Model::with_likeliest_process);
        let mut suspects: Vec<Blunder> = Vec::new();
        for each in std::iter::once(model).chain(bare.as_ref().filter(|_| !model.terms.is_empty())) {
            if let Some((gain, blunder)) = likeliest(each)
                && gain > 0.0
                && !suspects.contains(&blunder)
            {
                suspects.push(blunder);
            }
        }
        suspects
    }

    /// Models that have another effect, or none, in the place of one of the best's.
    fn rivals(&self, best: &Model<'a>) -> Vec<Model<'a>> {
        let mut rivals = Vec::new();
        for i in 0..best.terms.len() {
            let mut terms = best.terms.clone();
            let own = terms.remove(i);
            let Some(others) = Model::new(self.runs, best.process, &terms) else { continue };
            for effect in self.finalists(&others, false) {
                if effect == own.effect {
                    continue;
                }
                let mut with = terms.clone();
                with.push(self.term(&others, &effect));
                rivals.extend(Model::new(self.runs, best.process, &with).filter(|each| self.is_allowed(each)));
            }
            rivals.push(others);
        }
        rivals
    }

    /// A model with the one effect more by which the score gains most.
    fn widened(&self, model: &Model<'a>) -> Option<Model<'a>> {
        // Beside the process as it is, and at first beside none: a process may have taken for its own what is an effect.
        let mut finalists = self.finalists(model, true);
        if model.process.is_some()
            && model.terms.is_empty()
            && let Some(without) = Model::new(self.runs, None, &model.terms)
        {
            finalists.extend(self.finalists(&without, true));
        }
        let with = |effect: &Effect| {
            let mut terms = model.terms.clone();
            terms.push(self.term(model, effect));
            let widened = Model::new(self.runs, model.process, &terms)?;
            Some(widened.with_likeliest_process())
        };
        finalists
            .par_iter()
            .filter_map(with)
            .filter(|each| self.is_allowed(each))
            .max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)))
    }

    /// Whether a model file has room for the effects, and none is larger than its port allows.
    fn is_allowed(&self, model: &Model<'_>) -> bool {
        let effects = model.terms.iter().map(|term| term.effect.clone()).collect();
        if (ErrorModel { effects, ..ErrorModel::default() }).validate().is_err() {
            return false;
        }
        let means = model.fit.scaled_means();
        let mut first = 0;
        model.terms.iter().all(|term| {
            let own = means.get(first..first + term.columns.len()).unwrap_or_default();
            first += own.len();
            let most = match term.effect.port {
                Port::Rate => return true,
                Port::Scale => MOST_SCALE,
                Port::Index => MOST_INDEX_DEG,
                Port::Forward | Port::Left => MOST_LEVEL_G,
            };
            // At the port of the rate its functions are themselves.
            let functions = self.bank.library.values(self.runs, &Effect::new(Port::Rate, &term.effect.factors));
            let rows = functions.first().map_or(0, Vec::len);
            let at = |row: usize| functions.iter().zip(own).map(|(function, mean)| mean * function[row]).sum::<f64>();
            (0..rows).map(|row| at(row).powi(2)).sum::<f64>() <= most * most * rows as f64
        })
    }

    /// An effect as a term beside a model, of the size that suits it best.
    fn term(&self, model: &Model<'_>, effect: &Effect) -> Term {
        let values = Arc::new(self.bank.library.values(self.runs, effect));
        let (_, size2) = model.fit.gain_of(&model.problem, &model.terms, &model.problem.columns(&values));
        Term { effect: effect.clone(), values, columns: Vec::new(), size2: size2.max(1e-20) }
    }

    /// The most promising effects beside a model, tuned, and where `thorough` changed for better neighbours.
    fn finalists(&self, model: &Model<'_>, thorough: bool) -> Vec<Effect> {
        let weighed = self.weighed(model);
        let shortlist = self.bank.shortlist(&weighed, SHORTLIST);
        let mut exact: Vec<(f64, Effect)> =
            shortlist.par_iter().map(|effect| (self.gain(model, effect), (*effect).clone())).collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<(f64, Effect)> = Vec::new();
        for (gain, effect) in exact {
            if chosen.len() < FINALISTS && !chosen.iter().any(|(_, each)| alike(each, &effect)) {
                chosen.push((gain, effect));
            }
        }
        chosen.retain(|(gain, _)| *gain > -HOPE);
        let finish = |(gain, effect)| {
            if thorough && gain > 0.0 {
                self.climb(model, effect, gain, &weighed)
            } else {
                self.tuned(model, effect, gain).1
            }
        };
        chosen.into_par_iter().map(finish).collect()
    }

    /// V⁻¹ times what a model leaves of the residual, by the row.
    fn weighed(&self, model: &Model<'_>) -> Vec<f64> {
        model.problem.weighed(&model.problem.left(&model.terms, &model.fit))
    }

    /// The gain in evidence less the cost of an effect beside a model.
    fn gain(&self, model: &Model<'_>, effect: &Effect) -> f64 {
        let columns = model.problem.columns(&self.bank.library.values(self.runs, effect));
        model.fit.gain_of(&model.problem, &model.terms, &columns).0 - self.grammar.cost(effect)
    }

    /// From form to neighbouring form, as long as the gain grows by more than chance.
    fn climb(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64, weighed: &[f64]) -> Effect {
        (gain, effect) = self.tuned(model, effect, gain);
        for _ in 0..CLIMBS {
            let near = neighbours(&effect, &self.grammar, self.runs, &self.gates);
            let coarse = self.bank.coarse_sums(weighed);
            let promise =
                |each: Effect| (self.bank.promise(self.runs, &each, &coarse) - self.grammar.cost(&each), each);
            let mut promising: Vec<(f64, Effect)> = near.into_par_iter().map(promise).collect();
            promising.sort_by(|a, b| b.0.total_cmp(&a.0));
            promising.truncate(NEAREST);
            let mut better: Vec<(f64, Effect)> =
                promising.into_par_iter().map(|(_, each)| (self.gain(model, &each), each)).collect();
            better.sort_by(|a, b| b.0.total_cmp(&a.0));
            better.truncate(2);
            let best =
                better.into_iter().map(|(gain, each)| self.tuned(model, each, gain)).max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((above, each)) if above > gain + 0.5 => (gain, effect) = (above, each),
                _ => break,
            }
        }
        effect
    }

    /// The constants of an effect by turns, to the greatest gain.
    fn tuned(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64) -> (f64, Effect) {
        for (f, number) in constants_of(&effect) {
            let mut step = 0.35;
            while step > 0.04 {
                let mut moved = false;
                for sign in [1.0, -1.0] {
                    let Some(each) = moved_constant(&effect, f, number, sign * step) else { continue };
                    let above = self.gain(model, &each);
                    if above > gain {
                        (gain, effect, moved) = (above, each, true);
                        break;
                    }
                }
                if !moved {
                    step *= 0.5;
                }
            }
        }
        (gain, effect)
    }

    /// Without the terms that the evidence does not miss.
    fn pruned(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            let without = |i: usize| {
                let mut terms = model.terms.clone();
                terms.remove(i);
                Model::new(self.runs, model.process, &terms)
            };
            let best = (0..model.terms.len())
                .filter_map(without)
                .max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)));
            match best {
                Some(fewer) if fewer.score(&self.grammar) > model.score(&self.grammar) => model = fewer,
                _ => return model,
            }
        }
    }

    /// Every term once more beside the others: its neighbouring forms and its constants.
    fn revised(&self, mut model: Model<'a>) -> Model<'a> {
        for i in 0..model.terms.len() {
            let mut terms = model.terms.clone();
            let own = terms.remove(i);
            let Some(others) = Model::new(self.runs, model.process, &terms) else { continue };
            let weighed = self.weighed(&others);
            let found = self.climb(&others, own.effect.clone(), self.gain(&others, &own.effect), &weighed);
            if found == own.effect {
                continue;
            }
            terms.insert(i, self.term(&others, &found));
            if let Some(revised) = Model::new(self.runs, model.process, &terms).map(Model::with_likeliest_process)
                && revised.score(&self.grammar) > model.score(&self.grammar)
                && self.is_allowed(&revised)
            {
                model = revised;
            }
        }
        self.pruned(model)
    }
}

/// Of the same port, signals and dynamics' kinds: the constants and shapes of one are tuned to those of the other.
fn alike(a: &Effect, b: &Effect) -> bool {
    let form = |effect: &Effect| {
        let mut words: Vec<String> = effect
            .factors
            .iter()
            .map(|factor| {
                format!(
                    "{} {:?}",
                    factor.signal,
                    factor.dynamics.iter().map(|each| each.to_string()).collect::<Vec<_>>()
                )
            })
            .collect();
        words.sort();
        (effect.port, words)
    };
    form(a) == form(b)
}

fn constants_of(effect: &Effect) -> Vec<(usize, usize)> {
    effect
        .factors
        .iter()
        .enumerate()
        .flat_map(|(f, factor)| (0..factor.constants().len()).map(move |number| (f, number)))
        .collect()
}

/// The effect with one constant moved by a step: of its logarithm where it is a scale, of a width or of the signal's unit where it is a place.
fn moved_constant(effect: &Effect, f: usize, number: usize, step: f64) -> Option<Effect> {
    let mut effect = effect.clone();
    let factor = effect.factors.get_mut(f)?;
    let constants = factor.constants();
    let constant = constants.get(number)?;
    let value = if constant.is_scale {
        constant.value * step.exp()
    } else {
        let width = constants.iter().find(|each| each.is_scale).map(|each| each.value).or(match factor.shape {
            north_finder::effects::shape::Shape::Hinge(hinge) => Some(hinge.scale.into()),
            _ => None,
        });
        constant.value + step * width.unwrap_or(constant.value.abs().max(1.0) * 0.2)
    };
    factor.set(number, value);
    effect.validate().ok().map(|()| effect)
}

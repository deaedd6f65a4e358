//! The choice of the model: proposals by a score, decisions by the evidence.

use std::collections::BTreeMap;
use std::sync::Arc;

use north_finder::effects::doubt::Process;
use north_finder::effects::dynamics::Dynamics;
use north_finder::effects::effect::{Effect, MAX_FACTORS, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Harmonic, Shape};
use north_finder::effects::{ErrorModel, MAX_EFFECTS};
use rayon::prelude::*;

use super::bank::{Bank, Left};
use super::family::{Common, Family, Known, Way};
use super::grammar::{Grammar, complexity, extended, fineness, reduced, replaced, reshaped};
use super::model::{Model, is_within};
use super::pairs::Pairs;
use super::problem::Term;
use super::references::{Blunder, MOST_BLUNDERS, likeliest};
use super::rows::Run;
use super::triples::Triples;

/// A campaign without any effect must name one in at most this share of campaigns: by Markov's inequality the evidence for an effect, times the
/// probability of its form, exceeds the evidence for none by more than one over this share in at most this share of them.
const FALSE_DISCOVERIES: f64 = 1.0 / 200.0;
/// The same for a further effect beside one that was found; smaller odds decide nothing between two models.
pub const FURTHER_FALSE_DISCOVERIES: f64 = 1.0 / 20.0;
/// Most effects of a model: what its file and a board have room for.
const MOST_EFFECTS: usize = MAX_EFFECTS;
/// Most that an error of the index or of the level may be, root mean square, degrees and g: the equations are linear in it, and leave out e²/2 of the
/// rate, 0.4 % at 5°. What is larger is another effect, which this one stands for.
const MOST_INDEX_DEG: f64 = 5.0;
const MOST_LEVEL_G: f64 = 0.087;
/// Most that the scale factor may change by, root mean square.
const MOST_SCALE: f64 = 0.2;
/// Proposals whose exact evidence is computed, and those that are tuned: of one factor or two, and of three, which do not displace the others.
const SHORTLIST: usize = 40;
const OF_THREE: usize = 10;
const CONTENDERS: usize = 6;
const CONTENDERS_OF_THREE: usize = 2;
const FINALISTS: usize = 3;
/// What tuning may add to the gain of a proposal whose constants lie at most half a step of the bank's from the best, nats; below it a proposal is dropped.
const HOPE: f64 = 3.0;
/// Share of what a product explains that it keeps without one factor where it stands for two effects, and of what is missing then that an effect explains with the
/// constants that it is proposed with.
const MOSTLY: f64 = 0.5;
const PROMISED: f64 = 0.5;
/// A form that is less likely than another by more than this is no rival of it, nats: e^-4 is two in a hundred.
pub const NEGLIGIBLE: f64 = 4.0;
/// Neighbours of a form whose exact evidence is computed, and those of them that are tuned.
const NEAREST: usize = 12;
const TUNED: usize = 2;
/// Factors that are tried as a further one.
const FURTHER: usize = 4;
/// Most changes of form in a row.
const REACH_OF_CONTENDERS: usize = 2;
const REACH: usize = 6;
/// Unit in which the edges of a sector are tuned.
const SECTOR_STEP_DEG: f64 = 60.0;
/// First step of a constant, in its unit.
const FIRST_STEP: f64 = 0.35;

/// How thoroughly an effect's constants are tuned: rounds over all of them, and the smallest step.
struct Tuning {
    rounds: usize,
    least_step: f64,
}

const ROUGHLY: Tuning = Tuning { rounds: 1, least_step: 0.1 };
const FINELY: Tuning = Tuning { rounds: 3, least_step: 0.02 };

/// An effect that was proposed, and what it would be worth by itself.
#[derive(Clone, Debug)]
pub struct Tried {
    pub effect: Effect,
    /// What the evidence gains by it beside a process of the runs' own, and what its form costs, nats.
    pub gain: f64,
    pub cost: f64,
}

/// What a search begins with.
#[derive(Clone, Debug, Default)]
pub struct Start {
    effects: Vec<Effect>,
    process: Option<Process>,
}

impl From<&Model<'_>> for Start {
    fn from(model: &Model<'_>) -> Self {
        Self { effects: model.found(), process: model.process }
    }
}

/// The search's tools.
pub struct Search<'a> {
    pub runs: &'a [Run],
    pub grammar: Grammar,
    pub family: &'a Family,
    bank: Bank,
    pairs: Pairs,
    triples: Triples,
}

impl<'a> Search<'a> {
    pub fn new(runs: &'a [Run], family: &'a Family) -> Self {
        let grammar = Grammar::new(runs);
        let bank = Bank::new(runs, &grammar, &grammar.factors(runs));
        let pairs = Pairs::new(runs, &grammar, &bank);
        let triples = Triples::new(runs, &grammar, &bank);
        Self { runs, grammar, family, bank, pairs, triples }
    }

    /// Searches for the model with the greatest score, from `start`: nothing, or what an earlier search found with another reference for one run. Where
    /// revising the effects raises the score by more than a further effect must, further ones are searched for again. Where products were found, they are
    /// taken apart, and effects of one factor compete with them, which a product may have taken in and hide. `None` where the runs determine no model.
    pub fn best(&self, start: &Start) -> Option<Model<'a>> {
        let bare = Model::new(self.runs, None, &[])?;
        let terms: Vec<Term> = start.effects.iter().map(|effect| self.term(&bare, effect)).collect();
        let model =
            self.with_family(self.pruned(Model::new(self.runs, start.process, &terms)?.with_likeliest_process()));
        let best = self.taken_apart(self.completed(model, &start.effects));
        let is_product = |term: &Term| term.known.is_none() && term.effect.factors.len() > 1;
        if !best.terms.iter().any(is_product) {
            return Some(best);
        }
        let plain = self.plain_model(best.terms.len() + 1)?;
        Some(if plain.score(&self.grammar) > best.score(&self.grammar) { self.completed(plain, &[]) } else { best })
    }

    /// Takes products apart. A product may have taken in what several effects cause: as one more factor it costs less than an effect of its own. Each
    /// is replaced by the same with one factor less and the effect that is missing then; the likeliest such model is completed.
    fn taken_apart(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            let score = model.score(&self.grammar);
            let simpler = (0..model.terms.len()).into_par_iter().filter_map(|i| self.mostly_explained(&model, i));
            let promising =
                simpler.filter(|each| self.promise_beside(each) > PROMISED * (score - each.score(&self.grammar)));
            let apart = promising.filter_map(|each| self.widened_by(&each, |model| self.finalists(model)));
            let likeliest = apart.max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)));
            let better =
                likeliest.filter(|each| each.score(&self.grammar) > score).map(|each| self.completed(each, &[]));
            match better {
                Some(better) if better.score(&self.grammar) > score - FURTHER_FALSE_DISCOVERIES.ln() => model = better,
                _ => return model,
            }
        }
    }

    /// Gain of the most promising effect beside a model, with the constants that it is proposed with.
    fn promise_beside(&self, model: &Model<'a>) -> f64 {
        self.chosen(model).1.first().map_or(f64::NEG_INFINITY, |(gain, _)| *gain)
    }

    /// A model with one of its effects without the factor that is missed least, where that still explains most of what the effect does.
    fn mostly_explained(&self, model: &Model<'a>, i: usize) -> Option<Model<'a>> {
        let scored = self.with_one_simpler(model, i).into_iter().map(|each| (each.score(&self.grammar), each));
        let (score, simpler) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let without = self.without(model, i)?.score(&self.grammar);
        (score - without > MOSTLY * (model.score(&self.grammar) - without)).then_some(simpler)
    }

    /// The model that effects of one factor make, so many at most.
    fn plain_model(&self, most: usize) -> Option<Model<'a>> {
        let mut model = Model::new(self.runs, None, &[])?.with_likeliest_process();
        while model.terms.len() < most
            && let Some(wider) = self.widened_by(&model, |model| self.plain(model))
            && wider.score(&self.grammar) > model.score(&self.grammar)
        {
            model = wider;
        }
        Some(model)
    }

    /// Adds effects and revises them, until neither helps, or nothing was added to what there was at first.
    fn completed(&self, mut model: Model<'a>, first: &[Effect]) -> Model<'a> {
        loop {
            model = self.grown(model);
            if model.found() == first {
                return model;
            }
            let before = model.score(&self.grammar);
            model = self.revised(model);
            if model.score(&self.grammar) - before <= -FURTHER_FALSE_DISCOVERIES.ln() {
                return model;
            }
        }
    }

    /// Adds effects one after the other, as long as both evidence and prediction rise.
    fn grown(&self, mut model: Model<'a>) -> Model<'a> {
        while model.terms.len() < MOST_EFFECTS {
            let Some(wider) = self.widened_by(&model, |model| self.finalists(model)) else { break };
            let more = wider.score(&self.grammar) - model.score(&self.grammar);
            if more <= asked_beside(model.found().len())
                || wider.predictive(&self.grammar) <= model.predictive(&self.grammar)
            {
                break;
            }
            model = self.with_family(self.pruned(wider));
        }
        model
    }

    /// How well every run is predicted from the others by a model, less what it costs, and less the odds against as many effects; nats.
    pub fn plausible(&self, model: &Model<'_>) -> f64 {
        model.predictive(&self.grammar) - (0..model.found().len()).map(asked_beside).sum::<f64>()
    }

    /// Adds the effects of the instrument's family that this unit more likely has than not.
    fn with_family(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            let has = |member: usize| model.known().any(|known| known.member == member);
            let missing: Vec<usize> = (0..self.family.members.len()).filter(|&member| !has(member)).collect();
            let wider = missing
                .into_par_iter()
                .flat_map_iter(|member| [Way::Family, Way::Own].map(|way| (member, way)))
                .filter_map(|(member, way)| self.with_member(&model, member, way))
                .max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)))
                .map(Model::with_likeliest_process);
            match wider {
                Some(wider) if wider.score(&self.grammar) > model.score(&self.grammar) => model = wider,
                _ => return model,
            }
        }
    }

    /// Adds one effect of the family, and tunes its constants within what they differ by from unit to unit. It is tried with the process of the model and
    /// without it, because the process may have absorbed the effect.
    fn with_member(&self, model: &Model<'a>, member: usize, way: Way) -> Option<Model<'a>> {
        let common = self.family.members.get(member)?;
        let with = |effect: Effect| {
            let mut terms = model.terms.clone();
            terms.push(self.known(common, effect, member, way));
            let of = |process| Model::new(self.runs, process, &terms).filter(|each| self.is_allowed(each));
            let alone = model.process.and_then(|_| of(None));
            of(model.process)
                .into_iter()
                .chain(alone)
                .map(|each| (each.score(&self.grammar), each))
                .max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut effect = Effect::new(common.effect.port, &common.effect.factors);
        let mut best = with(effect.clone())?;
        let constants = constants_of(&effect).into_iter().zip(&common.spreads);
        for ((f, number), spread) in constants.filter(|(_, spread)| **spread > 0.0) {
            for step in [2.0 * spread, *spread, 0.5 * spread] {
                for sign in [1.0, -1.0] {
                    let Some(each) = moved_by(&effect, f, number, sign * step) else { continue };
                    match with(each.clone()) {
                        Some(better) if better.0 > best.0 => (best, effect) = (better, each),
                        _ => {}
                    }
                }
            }
        }
        Some(best.1)
    }

    /// An effect of the family as a term.
    fn known(&self, common: &Common, effect: Effect, member: usize, way: Way) -> Term {
        let mut prior = common.prior(way);
        prior.cost += common.cost_of_constants(&effect);
        Term::known(&self.bank.library, self.runs, &effect, Known { member, way, prior: Arc::new(prior) })
    }

    /// Compares a model with its rivals, which differ from it by one effect, and goes on from a rival that is likelier and predicts better. Gives the
    /// best model and its rivals.
    pub fn with_rivals(&self, mut best: Model<'a>) -> (Model<'a>, Vec<Model<'a>>) {
        loop {
            let rivals = self.rivals(&best);
            let least = best.score(&self.grammar) - FURTHER_FALSE_DISCOVERIES.ln();
            let better = rivals
                .iter()
                .filter(|each| {
                    each.score(&self.grammar) > least && each.predictive(&self.grammar) > best.predictive(&self.grammar)
                })
                .max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)));
            match better.and_then(|each| self.best(&each.into())) {
                Some(further) if further.score(&self.grammar) > least => best = further,
                _ => return (best, rivals),
            }
        }
    }

    /// A model without each of its effects, and without each factor of an effect, in turn, the likeliest first, with their scores.
    pub fn with_one_less(&self, model: &Model<'a>) -> Vec<(f64, Model<'a>)> {
        let scored = |fewer: Model<'a>| (fewer.score(&self.grammar), fewer);
        let fewer = self.fewer(model).filter(|each| !each.terms.is_empty());
        let mut fewer: Vec<(f64, Model<'a>)> = fewer.map(Model::with_likeliest_process).map(scored).collect();
        fewer.sort_by(|a, b| b.0.total_cmp(&a.0));
        fewer
    }

    /// A model without each of its effects, and without each factor of an effect, in turn.
    fn fewer(&self, model: &Model<'a>) -> impl Iterator<Item = Model<'a>> {
        let simpler = (0..model.terms.len()).flat_map(|i| self.with_one_simpler(model, i));
        self.without_each(model).chain(simpler)
    }

    /// A model with one of its effects without each of its factors in turn.
    fn with_one_simpler(&self, model: &Model<'a>, i: usize) -> Vec<Model<'a>> {
        let mut terms = model.terms.clone();
        let own = terms.remove(i);
        let Some(others) = Model::new(self.runs, model.process, &terms) else { return Vec::new() };
        let simpler = if own.known.is_some() { Vec::new() } else { reduced(&own.effect) };
        let simpler = simpler.into_par_iter().filter(|effect| !effect.factors.is_empty());
        let with = |effect: Effect| {
            let (_, effect) = self.tuned(&others, effect.clone(), self.gain(&others, &effect), &FINELY);
            let mut with = terms.clone();
            with.push(self.term(&others, &effect));
            Model::new(self.runs, model.process, &with)
        };
        simpler.filter_map(with).collect()
    }

    /// References that may be wrong, the likeliest first. They are tested beside all effects of the model, beside none, and beside all but each effect and
    /// each factor, because either may have been found in place of wrong references: of what it explains one of them explains its share at least.
    pub fn suspects(&self, model: &Model<'a>) -> Vec<Blunder> {
        if self.runs.iter().all(|run| run.reference.is_none()) {
            return Vec::new();
        }
        let of = |terms: &[Term]| Model::new(self.runs, model.process, terms);
        let none = of(&[]).filter(|_| model.terms.len() > 1);
        let beside = of(&model.terms).into_iter().chain(self.fewer(model)).chain(none);
        let mut suspects: Vec<(f64, Blunder)> = Vec::new();
        for before in beside.map(Model::with_likeliest_process) {
            let score = before.score(&self.grammar);
            if let Some((gain, blunder)) = likeliest(&before)
                && gain > 0.0
                && gain > (model.score(&self.grammar) - score) / MOST_BLUNDERS as f64
            {
                suspects.push((score + gain, blunder));
            }
        }
        suspects.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut unlike: Vec<Blunder> = Vec::new();
        for (_, blunder) in suspects {
            if !unlike.contains(&blunder) {
                unlike.push(blunder);
            }
        }
        unlike
    }

    /// What is proposed when nothing is known yet, the most promising first: the best forms of every signal at every port, and products.
    pub fn tried(&self) -> Vec<Tried> {
        let Some(bare) = Model::new(self.runs, None, &[]).map(Model::with_likeliest_process) else { return Vec::new() };
        let (_, proposed) = self.shortlist(&bare);
        let tried = |effect: Effect| {
            let cost = self.grammar.cost(&effect);
            Tried { gain: self.gain(&bare, &effect) + cost, cost, effect }
        };
        let mut all: Vec<Tried> = proposed.into_par_iter().map(tried).collect();
        all.sort_by(|a, b| (b.gain - b.cost).total_cmp(&(a.gain - a.cost)));
        let mut seen: Vec<String> = Vec::new();
        all.retain(|each| {
            let form = form(&each.effect);
            let is_new = !seen.contains(&form);
            if is_new {
                seen.push(form);
            }
            is_new
        });
        all
    }

    /// Models in which one effect of the best model is replaced by another one, or left out.
    fn rivals(&self, best: &Model<'a>) -> Vec<Model<'a>> {
        let mut rivals = Vec::new();
        for i in 0..best.terms.len() {
            let mut terms = best.terms.clone();
            let own = terms.remove(i);
            let Some(others) = Model::new(self.runs, best.process, &terms) else { continue };
            if let Some((known, _)) = &own.known {
                let other = if known.way == Way::Family { Way::Own } else { Way::Family };
                rivals.extend(self.with_member(&others, known.member, other));
                rivals.push(others);
                continue;
            }
            for effect in
                self.contenders(&others, &own.effect).into_iter().chain(self.other_forms(&others, &own.effect))
            {
                // Of its own form it differs by constants, which are tuned.
                if form(&effect) == form(&own.effect) {
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

    /// Other forms of an effect's signals that are about as likely beside a model.
    fn other_forms(&self, model: &Model<'_>, own: &Effect) -> Vec<Effect> {
        let left = self.bank.left(self.runs, &self.weighed(model), model.process.as_ref());
        self.as_likely(model, own, self.nearest(self.forms_of(own, &left), &left))
    }

    /// Effects of other signals that are about as likely.
    fn contenders(&self, model: &Model<'_>, own: &Effect) -> Vec<Effect> {
        let (_, chosen, _) = self.chosen(model);
        self.as_likely(model, own, chosen.into_iter().map(|(_, effect)| effect).collect())
    }

    /// Tunes these effects and keeps those that are at most [`NEGLIGIBLE`] less likely than `own` beside a model. Forms of equal [`complexity`] count alike.
    fn as_likely(&self, model: &Model<'_>, own: &Effect, effects: Vec<Effect>) -> Vec<Effect> {
        let likely = |effect: &Effect, gain: f64| gain + self.grammar.cost(effect) - complexity(effect);
        let least = likely(own, self.gain(model, own)) - NEGLIGIBLE;
        let tuned = |effect: Effect| {
            let gain = self.gain(model, &effect);
            (likely(&effect, gain) > least - HOPE).then(|| self.tuned(model, effect, gain, &ROUGHLY))
        };
        let near: Vec<(f64, Effect)> = effects.into_par_iter().filter_map(tuned).collect();
        near.into_iter().filter(|(gain, effect)| likely(effect, *gain) > least).map(|(_, effect)| effect).collect()
    }

    /// Adds the one of the effects that are proposed beside a model with which every run is predicted best from the others.
    fn widened_by(&self, model: &Model<'a>, proposed: impl Fn(&Model<'a>) -> Vec<Effect>) -> Option<Model<'a>> {
        // Beside the process as it is, and at first beside none: a process may have taken for its own what is an effect.
        let mut finalists = proposed(model);
        if model.process.is_some()
            && let Some(without) = Model::new(self.runs, None, &model.terms)
        {
            finalists.extend(proposed(&without));
        }
        let with = |effect: &Effect| {
            let mut terms = model.terms.clone();
            terms.push(self.term(model, effect));
            // An effect that a process had taken for its own is judged without it too.
            let of = |process| Model::new(self.runs, process, &terms).filter(|each| self.is_allowed(each));
            let both = of(model.process).into_iter().chain(model.process.and_then(|_| of(None)));
            both.map(|each| (each.predictive(&self.grammar), each)).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut widened: Vec<(f64, Model<'a>)> = finalists.par_iter().filter_map(with).collect();
        widened.sort_by(|a, b| b.0.total_cmp(&a.0));
        widened.truncate(FINALISTS);
        let finished = widened.into_par_iter().map(|(_, each)| each.with_likeliest_process());
        finished.max_by(|a, b| a.predictive(&self.grammar).total_cmp(&b.predictive(&self.grammar)))
    }

    /// Whether a model file has room for the effects, and none is larger than its port allows.
    fn is_allowed(&self, model: &Model<'_>) -> bool {
        if !is_writable(&model.effects()) {
            return false;
        }
        let most = |port: Port| match port {
            Port::Rate => f64::INFINITY,
            Port::Scale => MOST_SCALE,
            Port::Index => MOST_INDEX_DEG,
            Port::Forward | Port::Left => MOST_LEVEL_G,
        };
        model.added(|port| port != Port::Rate).iter().all(|(port, added)| is_within(added, most(*port)))
    }

    /// An effect as a term beside a model, of the size that suits it best.
    fn term(&self, model: &Model<'_>, effect: &Effect) -> Term {
        let term = Term::new(&self.bank.library, self.runs, effect, 1.0);
        let (_, size2) = model.fit.gain_of(&model.problem, &model.terms, &model.problem.columns(&term.values));
        Term { size2: size2.max(1e-20), ..term }
    }

    /// The most promising effects beside a model, each of other signals than those above it, and their gains; and the most promising bare shape of each of
    /// their signals, which a more flexible form may hide as long as neither is tuned. Before them what the model leaves.
    fn chosen(&self, model: &Model<'_>) -> (Left, Vec<(f64, Effect)>, Vec<Effect>) {
        let (left, shortlist) = self.shortlist(model);
        let mut exact: Vec<(f64, Effect)> =
            shortlist.into_par_iter().map(|effect| (self.gain(model, &effect), effect)).collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<(f64, Effect)> = Vec::new();
        let mut bare: Vec<Effect> = Vec::new();
        for (gain, effect) in exact.into_iter().filter(|(gain, _)| *gain > -HOPE) {
            let known = chosen.iter().map(|(_, each)| each).chain(&bare);
            let same: Vec<&Effect> = known.filter(|each| alike(each, &effect)).collect();
            let is_of_three = |each: &Effect| each.factors.len() > 2;
            let most = if is_of_three(&effect) { CONTENDERS_OF_THREE } else { CONTENDERS };
            let has_room = chosen.iter().filter(|(_, each)| is_of_three(each) == is_of_three(&effect)).count() < most;
            if same.is_empty() && has_room {
                chosen.push((gain, effect));
            } else if !same.is_empty() && is_bare(&effect) && !same.iter().any(|each| is_bare(each)) {
                bare.push(effect);
            }
        }
        (left, chosen, bare)
    }

    /// What a model leaves, and the effects that promise most by it.
    fn shortlist(&self, model: &Model<'_>) -> (Left, Vec<Effect>) {
        let weighed = self.weighed(model);
        let left = self.bank.left(self.runs, &weighed, model.process.as_ref());
        let mut shortlist = self.bank.shortlist(self.runs, &weighed, &left, SHORTLIST);
        shortlist.extend(self.pairs.shortlist(&left, &self.grammar, SHORTLIST));
        shortlist.extend(self.triples.shortlist(&left, &self.grammar, &self.bank, self.runs, OF_THREE));
        (left, shortlist)
    }

    /// The most promising effects beside a model, tuned and changed for better neighbours.
    fn finalists(&self, model: &Model<'_>) -> Vec<Effect> {
        let (left, chosen, bare) = self.chosen(model);
        // The plain ones stay in the competition: of what is flexible enough to take in several effects at once much is gained, and little learned.
        let plain = self.plain_of(model, &chosen, bare);
        let climb = |(gain, effect): (f64, Effect)| self.climb(model, effect, gain, &left, REACH_OF_CONTENDERS);
        let mut chosen: Vec<(f64, Effect)> = chosen.into_par_iter().map(climb).collect();
        chosen.sort_by(|a, b| b.0.total_cmp(&a.0));
        chosen.truncate(FINALISTS);
        let finish = |(gain, effect): (f64, Effect)| {
            let (gain, effect) = self.climb(model, effect, gain, &left, REACH);
            let (gain, effect) = self.tuned(model, effect, gain, &FINELY);
            self.simplified(model, effect, gain)
        };
        let mut finished: Vec<Effect> = chosen.into_par_iter().map(finish).collect();
        finished.extend(plain);
        finished
    }

    /// The most promising effects of one factor beside a model, tuned.
    fn plain(&self, model: &Model<'_>) -> Vec<Effect> {
        let (_, chosen, bare) = self.chosen(model);
        self.plain_of(model, &chosen, bare)
    }

    fn plain_of(&self, model: &Model<'_>, chosen: &[(f64, Effect)], bare: Vec<Effect>) -> Vec<Effect> {
        let of_one_factor = chosen.iter().map(|(_, each)| each).filter(|effect| effect.factors.len() < 2);
        let plain: Vec<Effect> = of_one_factor.cloned().chain(bare).collect();
        let tuned = |each: Effect| self.tuned(model, each.clone(), self.gain(model, &each), &FINELY).1;
        plain.into_par_iter().map(tuned).collect()
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

    /// Replaces the form by a neighbouring one, at most so many times, as long as the gain grows by more than half a nat. Where no form of its own signals,
    /// and none with one factor more, is better, one with another factor in the place of one may be.
    fn climb(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64, left: &Left, steps: usize) -> (f64, Effect) {
        for _ in 0..steps {
            let better = |forms: Vec<Effect>| self.best_of(model, forms, left).filter(|(above, _)| *above > gain + 0.5);
            let own = [self.forms_of(&effect, left), self.extensions_of(&effect, left)].concat();
            let best = better(own).or_else(|| better(self.exchanges_of(&effect, left)));
            let Some(best) = best else { break };
            (gain, effect) = best;
        }
        (gain, effect)
    }

    /// The best of some forms beside a model, roughly tuned, with its gain.
    fn best_of(&self, model: &Model<'_>, forms: Vec<Effect>, left: &Left) -> Option<(f64, Effect)> {
        let near = self.nearest(forms, left);
        let mut better: Vec<(f64, Effect)> = near.into_par_iter().map(|each| (self.gain(model, &each), each)).collect();
        better.sort_by(|a, b| b.0.total_cmp(&a.0));
        better.truncate(TUNED);
        better
            .into_par_iter()
            .map(|(gain, each)| self.tuned(model, each, gain, &ROUGHLY))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Removes factors, each simpler form finely tuned, as long as the gain does not fall.
    fn simplified(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64) -> Effect {
        loop {
            let simpler = reduced(&effect).into_par_iter();
            let best = simpler
                .map(|each| self.tuned(model, each.clone(), self.gain(model, &each), &FINELY))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((above, each)) if above >= gain => (gain, effect) = (above, each),
                _ => return effect,
            }
        }
    }

    /// Other forms of the same signals.
    fn forms_of(&self, effect: &Effect, left: &Left) -> Vec<Effect> {
        let mut forms = reshaped(effect, &self.grammar, self.runs);
        let shapes = (0..effect.factors.len()).into_par_iter().flat_map_iter(|f| self.other_shapes(effect, f, left));
        forms.extend(shapes.collect::<Vec<Effect>>());
        forms
    }

    /// The same with one factor more.
    fn extensions_of(&self, effect: &Effect, left: &Left) -> Vec<Effect> {
        if effect.factors.len() == MAX_FACTORS {
            return Vec::new();
        }
        let fitted = self.bank.fitted(self.runs, effect, left);
        extended(effect, &self.pairs.further(left, &fitted, FURTHER))
    }

    /// The same with another factor, of any signal, in the place of one.
    fn exchanges_of(&self, effect: &Effect, left: &Left) -> Vec<Effect> {
        let simpler = if effect.factors.len() > 1 { reduced(effect) } else { Vec::new() };
        simpler.iter().flat_map(|each| self.extensions_of(each, left)).collect()
    }

    /// The most promising forms, each once: effects of one form differ by constants, which are tuned.
    fn nearest(&self, forms: Vec<Effect>, left: &Left) -> Vec<Effect> {
        let promise = |each: Effect| (self.bank.promise(self.runs, &each, left) - self.grammar.cost(&each), each);
        let mut promising: Vec<(f64, Effect)> = forms.into_par_iter().map(promise).collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut seen: Vec<String> = Vec::new();
        let mut nearest: Vec<Effect> = Vec::new();
        for (_, each) in promising {
            let form = form(&each);
            if nearest.len() < NEAREST && !seen.contains(&form) {
                seen.push(form);
                nearest.push(each);
            }
        }
        nearest
    }

    /// Tunes every constant in turn, with steps that become smaller.
    fn tuned(&self, model: &Model<'_>, effect: Effect, gain: f64, tuning: &Tuning) -> (f64, Effect) {
        let constants = constants_of(&effect);
        self.tuned_by(effect, gain, tuning, &constants, &|each| self.gain(model, each))
    }

    /// The same with these constants, by another gain.
    fn tuned_by(
        &self,
        mut effect: Effect,
        mut gain: f64,
        tuning: &Tuning,
        constants: &[(usize, usize)],
        gain_of: &dyn Fn(&Effect) -> f64,
    ) -> (f64, Effect) {
        for _ in 0..tuning.rounds {
            let before = gain;
            for &(f, number) in constants {
                let unit = self.unit(&effect.factors[f], number);
                let least_step = tuning.least_step / fineness(&effect.factors[f]);
                let mut step = FIRST_STEP;
                while step > least_step {
                    let last = gain;
                    for sign in [1.0, -1.0] {
                        let Some(each) = moved_by(&effect, f, number, sign * step * unit) else { continue };
                        let above = gain_of(&each);
                        if above > gain {
                            (gain, effect) = (above, each);
                            break;
                        }
                    }
                    // By less than a third of a nat nobody tells two constants apart.
                    let has_gained = gain - last >= 0.3;
                    if !has_gained {
                        step *= 0.5;
                    }
                }
            }
            if gain < before + 1.0 {
                break;
            }
        }
        (gain, effect)
    }

    /// The effect with another shape in the place of one factor's, of every kind the one that promises most with its constants tuned in coarse rows:
    /// what is tuned already hides a better shape that is not.
    fn other_shapes(&self, effect: &Effect, f: usize, left: &Left) -> Vec<Effect> {
        let own = &effect.factors[f];
        let Some(span) = self.grammar.span(self.runs, own.signal, &own.dynamics) else { return Vec::new() };
        let seen = self.bank.seen_through(self.runs, effect, f);
        let gain_of = |each: &Effect| left.gain(&seen.columns(&each.factors[f])).0 - self.grammar.cost(each);
        let mut best: BTreeMap<String, (f64, Effect)> = BTreeMap::new();
        Shape::starts(&span, &mut |shape| {
            let factor = Factor { shape, ..own.clone() };
            let Some(each) = replaced(effect, f, factor) else { return };
            let gain = gain_of(&each);
            let known = best.entry(form(&each)).or_insert_with(|| (f64::NEG_INFINITY, each.clone()));
            if gain > known.0 {
                *known = (gain, each);
            }
        });
        let first = own.dynamics.iter().map(|dynamics| dynamics.constants().len()).sum::<usize>();
        let tuned = |(gain, each): (f64, Effect)| {
            let constants: Vec<(usize, usize)> =
                (first..first + each.factors[f].shape.constants().len()).map(|number| (f, number)).collect();
            self.tuned_by(each, gain, &ROUGHLY, &constants, &gain_of).1
        };
        best.into_values().map(tuned).collect()
    }

    /// Unit in which a constant of a factor is tuned: 1 for the logarithm of a scale; of a place the width that its shape has, or else the standard
    /// deviation of what the part gets; of a signal's ratio its size.
    fn unit(&self, factor: &Factor, number: usize) -> f64 {
        let constants = factor.constants();
        let Some(constant) = constants.get(number).filter(|constant| !constant.is_scale) else { return 1.0 };
        let deviation = |before: &[Dynamics]| {
            self.grammar.span(self.runs, factor.signal, before).map_or(1.0, |span| span.deviation)
        };
        let mut first = 0;
        for (place, dynamics) in factor.dynamics.iter().enumerate() {
            first += dynamics.constants().len();
            if number < first {
                return deviation(&factor.dynamics[..place]);
            }
        }
        let of_shape = factor.shape.constants();
        if number >= first + of_shape.len() {
            return constant.value.abs();
        }
        match factor.shape {
            Shape::Sector(_) => SECTOR_STEP_DEG,
            _ => of_shape
                .iter()
                .find(|each| each.is_scale)
                .map_or_else(|| deviation(&factor.dynamics), |width| width.value),
        }
    }

    /// Removes terms one after the other, as long as that raises the score.
    fn pruned(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            let best =
                self.without_each(&model).max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)));
            match best {
                Some(fewer) if fewer.score(&self.grammar) > model.score(&self.grammar) => model = fewer,
                _ => return model,
            }
        }
    }

    /// A model without each of its effects in turn.
    fn without_each(&self, model: &Model<'a>) -> impl Iterator<Item = Model<'a>> {
        (0..model.terms.len()).filter_map(|i| self.without(model, i))
    }

    fn without(&self, model: &Model<'a>, i: usize) -> Option<Model<'a>> {
        let mut terms = model.terms.clone();
        terms.remove(i);
        Model::new(self.runs, model.process, &terms)
    }

    /// Revises every term once beside the others, in form and constants, and then removes terms that are not needed any more.
    fn revised(&self, mut model: Model<'a>) -> Model<'a> {
        for i in 0..model.terms.len() {
            let mut terms = model.terms.clone();
            let own = terms.remove(i);
            if own.known.is_some() {
                continue;
            }
            let Some(others) = Model::new(self.runs, model.process, &terms) else { continue };
            let left = self.bank.left(self.runs, &self.weighed(&others), model.process.as_ref());
            let (gain, found) = self.climb(&others, own.effect.clone(), self.gain(&others, &own.effect), &left, REACH);
            let found = self.tuned(&others, found, gain, &FINELY).1;
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

/// Whether a model file has room for these effects.
pub fn is_writable(effects: &[Effect]) -> bool {
    let whole = || ErrorModel { effects: effects.iter().cloned().collect(), ..ErrorModel::default() };
    effects.len() <= MOST_EFFECTS && whole().validate().is_ok()
}

/// What a further effect must gain beside so many that were found, nats.
pub fn asked_beside(effects: usize) -> f64 {
    -(if effects == 0 { FALSE_DISCOVERIES } else { FURTHER_FALSE_DISCOVERIES }).ln()
}

/// The form of an effect: its name, and the orders of harmonics of angles, which no tuning leads from one to the other.
pub fn form(effect: &Effect) -> String {
    let order = |factor: &Factor| match factor.shape {
        Shape::Harmonic(Harmonic { period }) if factor.signal.is_angle() => format!(" {:.0}", 360.0 / period),
        _ => String::new(),
    };
    effect.to_string() + &effect.factors.iter().map(order).collect::<String>()
}

/// Of the same signals: ports, dynamics and shapes of one are tried for the other.
fn alike(a: &Effect, b: &Effect) -> bool {
    let signals = |effect: &Effect| {
        let mut signals: Vec<String> = effect.factors.iter().map(|factor| factor.signal.to_string()).collect();
        signals.sort();
        signals.dedup();
        signals
    };
    signals(a) == signals(b)
}

/// One factor without dynamics.
fn is_bare(effect: &Effect) -> bool {
    matches!(effect.factors.as_slice(), [factor] if factor.dynamics.is_empty())
}

fn constants_of(effect: &Effect) -> Vec<(usize, usize)> {
    effect
        .factors
        .iter()
        .enumerate()
        .flat_map(|(f, factor)| (0..factor.constants().len()).map(move |number| (f, number)))
        .collect()
}

/// The effect with one constant moved by so much: its logarithm where it is a scale, else by its own unit.
fn moved_by(effect: &Effect, f: usize, number: usize, step: f64) -> Option<Effect> {
    let mut effect = effect.clone();
    let factor = effect.factors.get_mut(f)?;
    let constant = *factor.constants().get(number)?;
    factor.set(number, if constant.is_scale { constant.value * step.exp() } else { constant.value + step });
    effect.validate().ok().map(|()| effect)
}

#[cfg(test)]
mod tests {
    use north_finder::effects::signal::Signal;

    use super::super::rows::IDENTITY;
    use super::*;

    /// A model file has room for eight effects: a ninth, which may be tried when a product is taken apart, is refused.
    #[test]
    fn a_model_has_room_for_eight_effects() {
        let effects = vec![Effect::new(Port::Rate, &[Factor::new(Signal::Since, &[], IDENTITY)]); 9];
        assert!(is_writable(&effects[..8]));
        assert!(!is_writable(&effects));
    }
}

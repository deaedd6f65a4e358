//! The choice of the model, by the evidence.

use std::sync::Arc;

use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::{ErrorModel, MAX_EFFECTS};
use rayon::prelude::*;

use super::family::{Common, Family, Known, Way};
use super::functions::Library;
use super::grammar::{Grammar, largest, reduced};
use super::model::{Model, is_within};
use super::problem::Term;
use super::proposals::{Proposals, alike, form};
use super::references::{Blunder, MOST_BLUNDERS, cost_of_less_accurate, less_accurate, likeliest, together};
use super::rows::Run;
use super::tuning::{constants_of, moved_by};

/// A campaign without any effect must name one in at most this share of campaigns: by Markov's inequality the evidence for an effect, times the
/// probability of its form, exceeds the evidence for none by more than one over this share in at most this share of them.
const FALSE_DISCOVERIES: f64 = 1.0 / 200.0;
/// The same for a further effect beside one that was found; smaller odds decide nothing between two models.
pub const FURTHER_FALSE_DISCOVERIES: f64 = 1.0 / 20.0;
/// Most effects of a model: what its file and a board have room for.
const MOST_EFFECTS: usize = MAX_EFFECTS;
/// Most that any of these may be in a single row, if it is an alternative to what was found, times its root mean square.
const MOST_IN_A_ROW: f64 = 3.0;
/// Models with one effect more that are looked at with the likeliest process of the runs' own, and with which a search begins.
const WIDENED: usize = 3;
/// Share of what a product explains that it keeps without one factor where it stands for two effects, and of what is missing then that an effect explains with the
/// constants that it is proposed with.
const LEAST_SHARE_KEPT: f64 = 0.5;
const LEAST_PROMISED_SHARE: f64 = 0.5;

/// What a search begins with.
#[derive(Clone, Debug, Default)]
pub struct Start {
    effects: Vec<Effect>,
    process: Option<Process>,
}

impl Start {
    /// These effects, and no process.
    pub fn with_effects(effects: Vec<Effect>) -> Self {
        Self { effects, process: None }
    }
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
    proposals: Proposals<'a>,
}

impl<'a> Search<'a> {
    /// `before`: what was evaluated in an earlier search in the same recordings.
    pub fn new(runs: &'a [Run], family: &'a Family, before: Option<&Library>) -> Self {
        let library = before.map_or_else(|| Library::new(runs), |before| before.in_runs(runs));
        let proposals = Proposals::new(runs, library);
        Self { runs, grammar: proposals.grammar.clone(), family, proposals }
    }

    /// Searches for the model with the greatest score, from `start`: nothing, or what an earlier search found with another reference for one run. Where
    /// revising the effects raises the score by more than a further effect must, further ones are searched for again. A search climbs to one maximum of many:
    /// from nothing it begins in several ways. The products of the likeliest model are taken apart. `None` where the runs determine no model.
    pub fn best(&self, start: &Start) -> Option<Model<'a>> {
        let bare = Model::new(self.runs, None, &[])?;
        let terms: Vec<Term> = start.effects.iter().map(|effect| self.proposals.term(&bare, effect)).collect();
        let model =
            self.with_family(self.pruned(Model::new(self.runs, start.process, &terms)?.with_likeliest_process()));
        let found = match start.effects.as_slice() {
            [] => self.begun_variously(model),
            first => self.completed(model, first),
        };
        Some(self.taken_apart(found))
    }

    /// The score of a model, less the odds against as many effects, nats.
    fn worth(&self, model: &Model<'_>) -> f64 {
        model.score(&self.grammar) - odds_against(model.found().len())
    }

    /// The likeliest model that the search finds beside a model when it begins with the effect that promises most; where one effect of one factor is not enough,
    /// also with each of the next ones, and with effects of one factor only, which a product may have taken in and hide.
    fn begun_variously(&self, model: Model<'a>) -> Model<'a> {
        let found = |begun: Model<'a>| self.completed(self.with_family(self.pruned(begun)), &[]);
        let mut beginnings = self.widened(&model, |model| self.proposals.finalists(model)).into_iter();
        let Some(first) = beginnings.next().filter(|first| self.is_worth_its_effect(&model, first)).map(found) else {
            return model;
        };
        let Some(factors) = factors_of_several(&first) else { return first };
        let others: Vec<Model<'a>> = beginnings.collect::<Vec<_>>().into_par_iter().map(found).collect();
        let all = std::iter::once(first).chain(others).chain(self.of_plain(factors));
        all.max_by(|a, b| self.worth(a).total_cmp(&self.worth(b))).unwrap_or(model)
    }

    /// Takes products apart. A product may have taken in what several effects cause: as one more factor it costs less than an effect of its own. Each
    /// is replaced by the same with one factor less and the effect that is missing then; the likeliest such model is completed.
    fn taken_apart(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            let score = model.score(&self.grammar);
            let simpler = (0..model.terms.len()).into_par_iter().filter_map(|i| self.mostly_explained(&model, i));
            let promising = simpler
                .filter(|each| self.promise_beside(each) > LEAST_PROMISED_SHARE * (score - each.score(&self.grammar)));
            let apart = promising.filter_map(|each| self.widened_by(&each, |model| self.proposals.finalists(model)));
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
        self.proposals.chosen(model).1.first().map_or(f64::NEG_INFINITY, |(gain, _)| *gain)
    }

    /// A model with one of its effects without the factor that is missed least, where that still explains most of what the effect does.
    fn mostly_explained(&self, model: &Model<'a>, i: usize) -> Option<Model<'a>> {
        let scored = self.with_one_simpler(model, i).into_iter().map(|each| (each.score(&self.grammar), each));
        let (score, simpler) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let without = self.without(model, i)?.score(&self.grammar);
        (score - without > LEAST_SHARE_KEPT * (model.score(&self.grammar) - without)).then_some(simpler)
    }

    /// The model that effects of one factor make, so many at most, revised and completed.
    fn of_plain(&self, most: usize) -> Option<Model<'a>> {
        let mut model = self.with_family(Model::new(self.runs, None, &[])?.with_likeliest_process());
        while model.terms.len() < most
            && let Some(wider) = self.widened_by(&model, |model| self.proposals.plain(model))
            && wider.score(&self.grammar) > model.score(&self.grammar)
        {
            model = wider;
        }
        Some(self.completed(self.revised(model), &[]))
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

    /// Adds effects one after the other, as long as both evidence and prediction rise. What was found before another one had taken in a part of it, and is revised.
    fn grown(&self, mut model: Model<'a>) -> Model<'a> {
        while model.terms.len() < MOST_EFFECTS {
            let Some(wider) = self.widened_by(&model, |model| self.proposals.finalists(model)) else { break };
            if !self.is_worth_its_effect(&model, &wider) {
                break;
            }
            model = self.with_family(self.pruned(wider));
            if model.terms.len() > 1 {
                model = self.revised(model);
            }
        }
        model
    }

    /// Whether both evidence and prediction rise by one more effect, the evidence by what is asked of it.
    fn is_worth_its_effect(&self, model: &Model<'_>, wider: &Model<'_>) -> bool {
        let more = wider.score(&self.grammar) - model.score(&self.grammar);
        more > asked_beside(model.found().len()) && wider.predictive(&self.grammar) > model.predictive(&self.grammar)
    }

    /// How well every run is predicted from the others by a model, less what it costs, and less the odds against as many effects; nats.
    pub fn plausible(&self, model: &Model<'_>) -> f64 {
        model.predictive(&self.grammar) - odds_against(model.found().len())
    }

    /// Whether a model is less plausible than something else of this plausibility, nats, also where all references are less accurate than was said: where the model lacks something,
    /// they miss by more than their sigmas though none is wrong.
    pub fn is_less_plausible(&self, model: &Model<'_>, than: f64) -> bool {
        let beside = |runs: &Vec<Run>| {
            let with = Model::new(runs, model.process, &model.terms);
            with.is_none_or(|with| self.plausible(&with) - cost_of_less_accurate() < than)
        };
        self.plausible(model) < than && less_accurate(self.runs).par_iter().all(beside)
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
        Term::known(&self.grammar.library, self.runs, &effect, Known { member, way, prior: Arc::new(prior) })
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

    /// A model without each of its effects, and without each factor of an effect, in turn, the likeliest first.
    pub fn with_one_less(&self, model: &Model<'a>) -> Vec<Model<'a>> {
        let fewer = self.fewer(model).filter(|each| !each.terms.is_empty()).map(Model::with_likeliest_process);
        let mut fewer: Vec<(f64, Model<'a>)> = fewer.map(|each| (each.score(&self.grammar), each)).collect();
        fewer.sort_by(|a, b| b.0.total_cmp(&a.0));
        fewer.into_iter().map(|(_, model)| model).collect()
    }

    /// A model without the effect that is missed least.
    pub fn with_one_effect_less(&self, model: &Model<'a>) -> Option<Model<'a>> {
        self.likeliest_without(model).map(Model::with_likeliest_process)
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
            let (_, effect) = self.proposals.finely_tuned(&others, effect);
            let mut with = terms.clone();
            with.push(self.proposals.term(&others, &effect));
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

    /// Several references that are wrong, where a simpler model with all of them put right predicts the runs better than the best model does, by more than the
    /// blunders cost: each alone need not be likelier than an effect, or a process, that was found in the place of all. The runs with them put right, and
    /// what the search begins with then.
    pub fn wrong_together(&self, best: &Model<'a>) -> Option<(Vec<Blunder>, Vec<Run>, Start)> {
        let none = Model::new(self.runs, None, &[]).filter(|_| !best.terms.is_empty());
        let beside = Model::new(self.runs, None, &best.terms).into_iter().chain(self.fewer(best)).chain(none);
        let mended = |model: Model<'a>| {
            let (blunders, runs) = together(&model);
            let then = model.in_runs_without_process(&runs)?.with_likeliest_process();
            let cost = blunders.iter().map(|blunder| blunder.cost(runs.len())).sum::<f64>();
            let (plausible, start) = (self.plausible(&then) - cost, Start::from(&then));
            (blunders.len() > 1).then_some((plausible, blunders, runs, start))
        };
        let (plausible, blunders, runs, start) = beside.filter_map(mended).max_by(|a, b| a.0.total_cmp(&b.0))?;
        self.is_less_plausible(best, plausible).then_some((blunders, runs, start))
    }

    /// Models in which one effect of the best model is replaced by another one, or left out.
    pub fn rivals(&self, best: &Model<'a>) -> Vec<Model<'a>> {
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
            for effect in self
                .proposals
                .contenders(&others, &own.effect)
                .into_iter()
                .chain(self.proposals.other_forms(&others, &own.effect))
            {
                // Of its own form it differs by constants, which are tuned.
                if form(&effect) == form(&own.effect) {
                    continue;
                }
                let mut with = terms.clone();
                with.push(self.proposals.term(&others, &effect));
                rivals.extend(Model::new(self.runs, best.process, &with).filter(|each| self.is_possible(each)));
            }
            rivals.push(others);
        }
        rivals
    }

    /// Adds the one of the effects that are proposed beside a model with which every run is predicted best from the others.
    fn widened_by(&self, model: &Model<'a>, proposed: impl Fn(&Model<'a>) -> Vec<Effect>) -> Option<Model<'a>> {
        self.widened(model, proposed).into_iter().next()
    }

    /// The model with each of the most promising of these effects more, each of other signals, by how well every run is predicted from the others, the best first.
    fn widened(&self, model: &Model<'a>, proposed: impl Fn(&Model<'a>) -> Vec<Effect>) -> Vec<Model<'a>> {
        // Beside the process as it is, and at first beside none: a process may have taken for its own what is an effect.
        let mut finalists = proposed(model);
        if model.process.is_some()
            && let Some(without) = Model::new(self.runs, None, &model.terms)
        {
            finalists.extend(proposed(&without));
        }
        let with = |effect: &Effect| {
            let mut terms = model.terms.clone();
            terms.push(self.proposals.term(model, effect));
            // An effect that a process had taken for its own is judged without it too.
            let of = |process| Model::new(self.runs, process, &terms).filter(|each| self.is_allowed(each));
            let both = of(model.process).into_iter().chain(model.process.and_then(|_| of(None)));
            both.map(|each| (each.predictive(&self.grammar), each)).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut widened: Vec<(f64, Model<'a>)> = finalists.par_iter().filter_map(with).collect();
        widened.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut effects: Vec<Effect> = Vec::new();
        widened.retain(|(_, each)| {
            let own = each.terms.last().map(|term| &term.effect);
            let new = own.filter(|own| effects.len() < WIDENED && !effects.iter().any(|other| alike(other, own)));
            effects.extend(new.cloned());
            new.is_some()
        });
        let finished = |(_, model): (f64, Model<'a>)| {
            let model = model.with_likeliest_process();
            (model.predictive(&self.grammar), model)
        };
        let mut finished: Vec<(f64, Model<'a>)> = widened.into_par_iter().map(finished).collect();
        finished.sort_by(|a, b| b.0.total_cmp(&a.0));
        finished.into_iter().map(|(_, each)| each).collect()
    }

    /// Whether a model file has room for the effects, and none is larger than its port allows.
    fn is_allowed(&self, model: &Model<'_>) -> bool {
        let is_small = |(port, added): &(Port, Vec<f64>)| is_within(added, largest(*port));
        is_writable(&model.effects()) && model.added(|port| port != Port::Rate).iter().all(is_small)
    }

    /// Whether it is allowed, and may be true in every row: an error in few rows has a small root mean square, whatever it is.
    fn is_possible(&self, model: &Model<'_>) -> bool {
        let in_every_row = |(port, added): &(Port, Vec<f64>)| {
            let most = MOST_IN_A_ROW * largest(*port);
            added.iter().all(|value| value.abs() <= most)
        };
        self.is_allowed(model) && model.added(|port| port != Port::Rate).iter().all(in_every_row)
    }

    /// Removes terms one after the other, as long as that raises the score.
    fn pruned(&self, mut model: Model<'a>) -> Model<'a> {
        loop {
            match self.likeliest_without(&model) {
                Some(fewer) if fewer.score(&self.grammar) > model.score(&self.grammar) => model = fewer,
                _ => return model,
            }
        }
    }

    /// A model without each of its effects in turn.
    fn without_each(&self, model: &Model<'a>) -> impl Iterator<Item = Model<'a>> {
        (0..model.terms.len()).filter_map(|i| self.without(model, i))
    }

    /// The likeliest of these.
    fn likeliest_without(&self, model: &Model<'a>) -> Option<Model<'a>> {
        self.without_each(model).max_by(|a, b| a.score(&self.grammar).total_cmp(&b.score(&self.grammar)))
    }

    /// A model without one of its effects.
    pub fn without(&self, model: &Model<'a>, i: usize) -> Option<Model<'a>> {
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
            let gain = self.proposals.gain(&others, &own.effect);
            let (_, found) = self.proposals.improved(&others, own.effect.clone(), gain, &self.proposals.left(&others));
            if found == own.effect {
                continue;
            }
            terms.insert(i, self.proposals.term(&others, &found));
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

/// How many factors the effects have that were found; `None` where there is only one effect of one factor, or none.
fn factors_of_several(model: &Model<'_>) -> Option<usize> {
    let factors = model.found().iter().map(|effect| effect.factors.len().max(1)).sum();
    (factors > 1).then_some(factors)
}

/// What a further effect must gain beside so many that were found, nats.
pub fn asked_beside(effects: usize) -> f64 {
    -(if effects == 0 { FALSE_DISCOVERIES } else { FURTHER_FALSE_DISCOVERIES }).ln()
}

/// The same of so many effects together.
pub fn odds_against(effects: usize) -> f64 {
    (0..effects).map(asked_beside).sum()
}

#[cfg(test)]
mod tests {
    use north_finder::effects::factor::Factor;
    use north_finder::effects::signal::Signal;

    use super::super::spans::IDENTITY;
    use super::*;

    /// A model file has room for eight effects: a ninth, which may be tried when a product is taken apart, is refused.
    #[test]
    fn a_model_has_room_for_eight_effects() {
        let effects = vec![Effect::new(Port::Rate, &[Factor::new(Signal::Since, &[], IDENTITY)]); 9];
        assert!(is_writable(&effects[..8]));
        assert!(!is_writable(&effects));
    }
}

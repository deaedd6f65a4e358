//! Effects that are proposed beside a model, by a score, and their exact gains in evidence.

use north_finder::effects::effect::Effect;
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Harmonic, Shape};
use rayon::prelude::*;

use super::bank::{Bank, Left};
use super::functions::Library;
use super::further::Further;
use super::grammar::{Grammar, complexity};
use super::model::{Model, NEGLIGIBLE};
use super::pairs::Pairs;
use super::problem::Term;
use super::rows::Run;
use super::triples::{Judges, Triples};

/// Proposals whose exact evidence is computed, and those that are tuned: of one factor or two, and of three, which do not displace the others.
const SHORTLIST: usize = 40;
const OF_THREE: usize = 10;
const CONTENDERS: usize = 6;
const CONTENDERS_OF_THREE: usize = 2;
const FINALISTS: usize = 3;
/// Factors that are tried beside a product of two.
const THIRDS: usize = 2;

/// How far products of three are sought: of how many sets of signals their factors are chosen, and beside how many products of two a third one is.
struct Reach {
    signals: usize,
    pairs: usize,
}

const NEAR: Reach = Reach { signals: OF_THREE, pairs: 0 };
const FAR: Reach = Reach { signals: 64, pairs: 24 };

/// What tuning may add to the gain of a proposal whose constants lie at most half a step of the bank's from the best, nats; below it a proposal is dropped.
const PROPOSAL_MARGIN_NATS: f64 = 3.0;

/// An effect that was proposed, and what it would be worth by itself.
#[derive(Clone, Debug)]
pub struct Tried {
    pub effect: Effect,
    /// What the evidence gains by it beside a process of the runs' own, and what its form costs, nats.
    pub gain: f64,
    pub cost: f64,
}

/// What proposes effects of some runs.
pub struct Proposals<'a> {
    pub runs: &'a [Run],
    pub grammar: Grammar,
    pub bank: Bank,
    pub further: Further,
    pairs: Pairs,
    triples: Triples,
}

impl<'a> Proposals<'a> {
    pub fn new(runs: &'a [Run], library: Library) -> Self {
        let grammar = Grammar::new(runs, library);
        let bank = Bank::new(runs, &grammar, &grammar.factors(runs));
        let further = Further::new(runs, &grammar, &bank);
        let pairs = Pairs::new(runs, &grammar, &bank);
        let triples = Triples::new(&grammar, &bank, &further);
        Self { runs, grammar, bank, further, pairs, triples }
    }

    /// An effect as a term beside a model, of the size that suits it best.
    pub fn term(&self, model: &Model<'_>, effect: &Effect) -> Term {
        model.term(&self.grammar.library, effect)
    }

    /// The gain in evidence less the cost of an effect beside a model.
    pub fn gain(&self, model: &Model<'_>, effect: &Effect) -> f64 {
        let columns = model.problem.columns(&self.grammar.library.values(self.runs, effect));
        model.fit.gain_of(&model.problem, &columns).0 - self.grammar.cost(effect)
    }

    /// What a model leaves.
    pub fn left(&self, model: &Model<'_>) -> Left {
        self.weighed_and_left(model).1
    }

    /// What is proposed when nothing is known yet, the most promising first: the best forms of every signal at every port, and products.
    pub fn tried(&self) -> Vec<Tried> {
        let Some(bare) = Model::new(self.runs, None, &[]).map(Model::with_likeliest_process) else { return Vec::new() };
        let (_, proposed) = self.shortlist(&bare, &NEAR);
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

    /// The most promising effects beside a model, tuned and changed for better neighbours.
    pub fn finalists(&self, model: &Model<'_>) -> Vec<Effect> {
        let (left, chosen, bare) = self.chosen_among(model, &FAR);
        // The plain ones remain in the competition: of what is flexible enough to take in several effects at once much is gained, and little learned.
        let plain = self.plain_of(model, &chosen, bare);
        let climb = |(gain, effect): (f64, Effect)| self.improved_a_little(model, effect, gain, &left);
        let mut chosen: Vec<(f64, Effect)> = chosen.into_par_iter().map(climb).collect();
        chosen.sort_by(|a, b| b.0.total_cmp(&a.0));
        chosen.truncate(FINALISTS);
        let finish = |(gain, effect): (f64, Effect)| {
            let (gain, effect) = self.improved(model, effect, gain, &left);
            self.simplified(model, effect, gain)
        };
        let mut finished: Vec<Effect> = chosen.into_par_iter().map(finish).collect();
        finished.extend(plain);
        finished
    }

    /// The most promising effects of one factor beside a model, tuned.
    pub fn plain(&self, model: &Model<'_>) -> Vec<Effect> {
        let (weighed, left) = self.weighed_and_left(model);
        let (chosen, bare) = self.unlike(model, self.bank.shortlist(self.runs, &weighed, &left, SHORTLIST));
        self.plain_of(model, &chosen, bare)
    }

    fn plain_of(&self, model: &Model<'_>, chosen: &[(f64, Effect)], bare: Vec<Effect>) -> Vec<Effect> {
        let of_one_factor = chosen.iter().map(|(_, each)| each).filter(|effect| effect.factors.len() < 2);
        let plain: Vec<Effect> = of_one_factor.cloned().chain(bare).collect();
        plain.into_par_iter().map(|each| self.finely_tuned(model, each).1).collect()
    }

    /// Other forms of an effect's signals that are about as likely beside a model.
    pub fn other_forms(&self, model: &Model<'_>, own: &Effect) -> Vec<Effect> {
        let left = self.left(model);
        self.as_likely(model, own, self.nearest(self.forms_of(own, &left), &left))
    }

    /// Effects of other signals that are about as likely.
    pub fn contenders(&self, model: &Model<'_>, own: &Effect) -> Vec<Effect> {
        let (_, chosen, _) = self.chosen(model);
        self.as_likely(model, own, chosen.into_iter().map(|(_, effect)| effect).collect())
    }

    /// Tunes these effects and keeps those that are at most [`NEGLIGIBLE`] less likely than `own` beside a model. Forms of equal [`complexity`] count alike.
    fn as_likely(&self, model: &Model<'_>, own: &Effect, effects: Vec<Effect>) -> Vec<Effect> {
        let likely = |effect: &Effect, gain: f64| gain + self.grammar.cost(effect) - complexity(effect);
        let least = likely(own, self.gain(model, own)) - NEGLIGIBLE;
        let tuned = |effect: Effect| {
            let gain = self.gain(model, &effect);
            (likely(&effect, gain) > least - PROPOSAL_MARGIN_NATS).then(|| self.roughly_tuned(model, effect, gain))
        };
        let near: Vec<(f64, Effect)> = effects.into_par_iter().filter_map(tuned).collect();
        near.into_iter().filter(|(gain, effect)| likely(effect, *gain) > least).map(|(_, effect)| effect).collect()
    }

    /// The most promising effects beside a model, each of other signals than those above it, and their gains; and the most promising bare shape of each of
    /// their signals, which a more flexible form may hide as long as neither is tuned. Before them what the model leaves.
    pub fn chosen(&self, model: &Model<'_>) -> (Left, Vec<(f64, Effect)>, Vec<Effect>) {
        self.chosen_among(model, &NEAR)
    }

    fn chosen_among(&self, model: &Model<'_>, reach: &Reach) -> (Left, Vec<(f64, Effect)>, Vec<Effect>) {
        let (left, shortlist) = self.shortlist(model, reach);
        let (chosen, bare) = self.unlike(model, shortlist);
        (left, chosen, bare)
    }

    /// Those of a shortlist that are best beside a model, as [`Self::chosen`] gives them.
    fn unlike(&self, model: &Model<'_>, shortlist: Vec<Effect>) -> (Vec<(f64, Effect)>, Vec<Effect>) {
        let mut exact: Vec<(f64, Effect)> =
            shortlist.into_par_iter().map(|effect| (self.gain(model, &effect), effect)).collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<(f64, Effect)> = Vec::new();
        let mut bare: Vec<Effect> = Vec::new();
        for (gain, effect) in exact.into_iter().filter(|(gain, _)| *gain > -PROPOSAL_MARGIN_NATS) {
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
        (chosen, bare)
    }

    /// V⁻¹ times what a model leaves of the residual, by the row, and what it leaves in coarse rows.
    fn weighed_and_left(&self, model: &Model<'_>) -> (Vec<f64>, Left) {
        let weighed = model.problem.weighed(&model.problem.left(&model.fit));
        let left = self.bank.left(self.runs, &weighed, model.process.as_ref());
        (weighed, left)
    }

    /// What a model leaves, and the effects that promise most by it.
    fn shortlist(&self, model: &Model<'_>, reach: &Reach) -> (Left, Vec<Effect>) {
        let (weighed, left) = self.weighed_and_left(model);
        let mut shortlist = self.bank.shortlist(self.runs, &weighed, &left, SHORTLIST);
        let pairs = self.pairs.shortlist(&left, &self.grammar, SHORTLIST);
        shortlist.extend(self.with_a_third(&pairs[..reach.pairs.min(pairs.len())], &left));
        shortlist.extend(pairs.into_iter().flatten());
        let Self { runs, grammar, bank, further, .. } = self;
        let judges = Judges { left: &left, runs, grammar, bank, further };
        shortlist.extend(self.triples.shortlist(&judges, reach.signals, OF_THREE));
        (left, shortlist)
    }

    /// The products of three that promise most of these products of two, each in its forms, with one factor more.
    fn with_a_third(&self, pairs: &[Vec<Effect>], left: &Left) -> Vec<Effect> {
        let with = |forms: &Vec<Effect>| {
            forms.last().map_or_else(Vec::new, |most_flexible| self.extensions_of(most_flexible, left, THIRDS))
        };
        let mut nearest = self.nearest(pairs.par_iter().flat_map_iter(with).collect(), left);
        nearest.truncate(OF_THREE);
        nearest
    }
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
pub fn alike(a: &Effect, b: &Effect) -> bool {
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

//! Effects found by one grammar: products of factors at a port, proposed by the thousand and chosen by their evidence.
//!
//! [`Recording`] → `rows` → `proposals`, of one factor (`bank`), two (`pairs`) and three (`triples`), changed for better neighbours (`tuning`) → `search` chooses, by the
//! evidence of a `model` → `posterior` says what was learned. Wrong references compete with effects (`references`); `discrimination`
//! says what further runs would tell.

mod bank;
mod discrimination;
mod evaluation_cache;
mod family;
mod functions;
mod further;
mod grammar;
mod membership;
mod model;
mod model_out;
mod pairs;
mod posterior;
mod problem;
mod process;
mod proposals;
mod rate_residual;
mod recording;
mod references;
mod rounding;
mod rows;
mod search;
mod spans;
mod triples;
mod tuning;
mod unknowns;

use std::sync::Arc;

pub use family::{Common, Family, OUTSIDE, Way};
pub use grammar::{MOST_INDEX_DEG, form_cost};
pub use membership::{Place, Standing, Statistics, Ways};
pub use posterior::Posterior;
pub use rate_residual::chi_square_by_freedom;
pub use recording::{Recording, Sample};
pub use references::Blunder;
use references::MOST_BLUNDERS;

pub use discrimination::{Imitated, imitated};
use functions::Library;
use grammar::Grammar;
use model::{LINEAR_INDEX_DEG, Model, NEGLIGIBLE, is_within};
use north_finder::effects::effect::{Effect, Port};
use north_finder::units::{wrap_180_deg, wrap_360_deg};
use problem::Term;
use proposals::Proposals;
pub use proposals::{Tried, form};
use rayon::prelude::*;
pub use rows::Run;
pub use search::asked_beside;
use search::{Search, Start, odds_against};

/// A model that some runs taught.
#[derive(Clone, Debug, Default)]
pub struct Taught {
    pub posterior: Posterior,
    /// Its evidence less what its form costs, nats.
    pub score: f64,
    /// By how much the score falls without each effect of the likeliest model, nats.
    pub gains: Vec<f64>,
}

impl Taught {
    /// What a model teaches, with this posterior.
    fn new<'a>(best: &Model<'a>, posterior: Posterior, search: &Search<'a>) -> Self {
        let score = best.score(&search.grammar);
        let gain = |i: usize| {
            let without = search.without(best, i).map(Model::with_likeliest_process);
            without.map_or(0.0, |without| score - without.score(&search.grammar))
        };
        let gains = (0..best.terms.len()).into_par_iter().map(gain).collect();
        Self { posterior, score, gains }
    }

    /// Of a model beside its rivals where that may be used, or else of it alone; `None` where neither may be.
    fn usable<'a>(
        best: &Model<'a>,
        rivals: &[Model<'a>],
        search: &Search<'a>,
        may_be_used: &MayBeUsed<'_>,
    ) -> Option<Self> {
        let mut posteriors = [rivals, &[]].into_iter().map(|rivals| Posterior::new(best, rivals));
        let posterior = posteriors.find(|posterior| may_be_used(posterior, search.runs))?;
        Some(Self::new(best, posterior, search))
    }

    /// How many effects the likeliest model has.
    pub fn effects(&self) -> usize {
        self.posterior.likeliest.len()
    }
}

/// What some runs taught.
#[derive(Clone, Debug, Default)]
pub struct Learned {
    /// The likeliest model.
    pub best: Taught,
    /// The same with one effect less each time, the one that is missed least; the last one has none.
    pub fewer: Vec<Taught>,
    /// The runs with their references put right.
    pub runs: Vec<Run>,
    /// What was wrong with the references, by the numbers of the runs.
    pub blunders: Vec<Blunder>,
}

impl Learned {
    /// The likeliest model and those with fewer effects.
    pub fn models(&self) -> impl Iterator<Item = &Taught> {
        std::iter::once(&self.best).chain(&self.fewer)
    }

    /// The score of the likeliest model less the odds against as many effects and what the blunders cost, nats: of the same recordings what is worth more is likelier.
    pub fn worth(&self) -> f64 {
        let blunders: f64 = self.blunders.iter().map(|blunder| blunder.cost(self.runs.len())).sum();
        self.best.score - odds_against(self.best.effects()) - blunders
    }

    /// Forgets the likeliest model, where there is a simpler one; whether there was.
    pub fn forget_best(&mut self) -> bool {
        let simpler = (!self.fewer.is_empty()).then(|| self.fewer.remove(0));
        simpler.map(|simpler| self.best = simpler).is_some()
    }

    /// The one without any effect.
    pub fn without_effects(&self) -> &Taught {
        self.fewer.last().unwrap_or(&self.best)
    }
}

/// Whether what was learned of these runs may be used: it leaves every run its azimuth.
pub type MayBeUsed<'a> = dyn Fn(&Posterior, &[Run]) -> bool + Sync + 'a;
/// The azimuths of these runs with what was learned, degrees.
pub type Azimuths<'a> = dyn Fn(&Posterior, &[Run]) -> Vec<Option<f64>> + Sync + 'a;

/// Times that the runs are linearised at the azimuths that a model gives them, and steps to these.
const MOST_TURNS: usize = 4;
const MOST_STEPS: usize = 16;
/// Runs are linearised near enough to their azimuths, root mean square, degrees: what goes with three times an angle changes by 0.5 % then.
const NEAR_DEG: f64 = 0.1;

/// What may be learned.
#[derive(Clone, Copy)]
pub struct Allowed<'a> {
    /// The effects of the instrument's family are likely beforehand, each in its way.
    pub family: &'a Family,
    /// What this refuses is learned without the effects that it is refused for, where it is not refused then.
    pub may_be_used: &'a MayBeUsed<'a>,
    pub azimuths: &'a Azimuths<'a>,
}

/// Runs as they were learned from: with these blunders of their references put right.
pub fn mended(mut runs: Vec<Run>, blunders: &[Blunder]) -> Vec<Run> {
    rows::linearise_by_station(&mut runs);
    blunders.iter().fold(runs, |runs, blunder| blunder.mended(&runs))
}

/// How many signals these runs have.
pub fn signals(runs: &[Run]) -> usize {
    Grammar::new(runs, Library::new(runs)).signals.len()
}

/// What is proposed of runs beside nothing, the most promising first.
pub fn tried(runs: &[Run]) -> Vec<Tried> {
    Proposals::new(runs, Library::new(runs)).tried()
}

/// What a column that is no effect's is worth.
#[derive(Clone, Copy, Debug)]
pub struct Worth {
    /// What the evidence gains by it, nats.
    pub log_odds: f64,
    /// Its weight and one sigma of it.
    pub weight: f64,
    pub sigma: f64,
}

/// Logarithm of the evidence of these runs without an effect, beside the process of the runs' own or the offsets of every rest that suit them best. `None` where the
/// runs determine no model.
pub fn evidence(runs: &[Run]) -> Option<f64> {
    Some(Model::new(runs, None, &[])?.with_likeliest_process_or_offsets().evidence())
}

/// What each column alone adds to what is known of these runs: its unit adds so much to the rates, °/h, by the row and all runs one after the other. Beside the
/// process of the runs' own that suits them best with it and without it, or offsets of every rest that do: what an effect adds to a dwell, a column that
/// differs from dwell to dwell may imitate. `None` where the runs determine no model
/// with it, or none at all.
pub fn gains_of(runs: &[Run], columns: Vec<Vec<f64>>) -> Option<Vec<Option<Worth>>> {
    let bare = Model::new(runs, None, &[])?;
    let without = evidence(runs)?;
    let worth = |column: Vec<f64>| {
        let values = vec![column];
        let columns = bare.problem.columns(&values);
        let (_, size2) = bare.fit.gain_of(&bare.problem, &columns);
        let effect = Effect::new(Port::Rate, &[]);
        let term = Term::of_rates(effect, values, size2.max(1e-20));
        let with = Model::new(runs, None, &[term])?.with_likeliest_process_or_offsets();
        Some(Worth {
            log_odds: with.evidence() - without,
            weight: with.fit.scaled_means().first().copied().unwrap_or_default(),
            sigma: with.fit.scaled_covariance().get((0, 0)).map_or(0.0, |variance| variance.sqrt()),
        })
    };
    Some(columns.into_par_iter().map(worth).collect())
}

/// Learns from runs.
pub fn learn(runs: Vec<Run>, allowed: &Allowed<'_>) -> Learned {
    learn_from(mended(runs, &[]), Vec::new(), Start::default(), allowed)
}

/// What is learned when the search begins with what some of the runs taught, where that is likelier of all of them than what was learned and predicts them
/// better; `None` where it is not: a search climbs to one maximum of many, and other runs lead it to another one. With a family the effects that are known lead it.
pub fn learn_again(learned: &Learned, of_some: &[&[Effect]], allowed: &Allowed<'_>) -> Option<Learned> {
    if !allowed.family.members.is_empty() {
        return None;
    }
    let grammar = Grammar::new(&learned.runs, Library::new(&learned.runs));
    let bare = Model::new(&learned.runs, None, &[])?;
    let worth = |effects: &[Effect]| worth_beside(&bare, &grammar, effects);
    let before = worth(&learned.best.posterior.likeliest)?;
    let is_better = |after: &[f64; 2]| after[0] > before[0] && after[1] > before[1];
    let better = of_some.par_iter().filter_map(|effects| Some((worth(effects).filter(is_better)?, *effects)));
    let (_, effects) = better.max_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]))?;
    let start = Start::with_effects(effects.to_vec());
    let again = learn_from(learned.runs.clone(), learned.blunders.clone(), start, allowed);
    let is_likelier = worth(&again.best.posterior.likeliest).as_ref().is_some_and(is_better);
    (again.blunders == learned.blunders && is_likelier).then_some(again)
}

/// The score of a model of these effects in the runs of a model without any, and the same by how well every run is predicted from the others, each less the odds
/// against as many effects, nats.
fn worth_beside(bare: &Model<'_>, grammar: &Grammar, effects: &[Effect]) -> Option<[f64; 2]> {
    let terms: Vec<Term> = effects.iter().map(|effect| bare.term(&grammar.library, effect)).collect();
    let model = Model::new(bare.problem.runs, None, &terms)?.with_likeliest_process();
    let asked = odds_against(effects.len());
    Some([model.score(grammar) - asked, model.predictive(grammar) - asked])
}

/// Learns from runs of which some references were put right, from a start.
///
/// A reference is put right, or not believed, where with everything that is learned then the runs predict each other better, by more than what a blunder
/// costs beforehand.
fn learn_from(mut runs: Vec<Run>, mut blunders: Vec<Blunder>, mut start: Start, allowed: &Allowed<'_>) -> Learned {
    let mut turned = 0;
    let mut before: Option<Arc<Library>> = None;
    loop {
        let search = Search::new(&runs, allowed.family, before.as_deref());
        before = Some(search.grammar.library.clone());
        let Some(best) = search.best(&start) else { return Learned { runs, blunders, ..Learned::default() } };
        if turned < MOST_TURNS
            && let Some((further, from)) = linearised_by(&best, &search.grammar, allowed.azimuths)
        {
            (runs, start) = (further, from);
            turned += 1;
            continue;
        }
        start = Start::from(&best);
        let suspects = if blunders.len() < MOST_BLUNDERS { search.suspects(&best) } else { Vec::new() };
        let likelier = suspects
            .into_iter()
            .find_map(|blunder| contradicted(&search, &best, &blunder).then(|| (blunder.mended(&runs), blunder)));
        if let Some((mended, blunder)) = likelier {
            blunders.push(blunder);
            runs = mended;
            continue;
        }
        let surveyed = blunders.is_empty() && runs.iter().any(|run| run.reference.is_some());
        if surveyed && let Some((wrong, mended, then)) = search.wrong_together(&best) {
            (blunders, runs, start) = (wrong, mended, then);
            continue;
        }
        let alone = |model: &Model<'_>| Taught::new(model, Posterior::new(model, &[]), &search);
        let (best, rivals) = search.with_rivals(best);
        let (best, model) = match Taught::usable(&best, &rivals, &search, allowed.may_be_used) {
            Some(taught) => (taught, best),
            None => with_fewer(&search, &best, allowed.may_be_used).unwrap_or_else(|| (alone(&best), best)),
        };
        let fewer =
            std::iter::successors(search.with_one_effect_less(&model), |model| search.with_one_effect_less(model));
        let taught = |model: Model<'_>| {
            Taught::usable(&model, &search.rivals(&model), &search, allowed.may_be_used)
                .unwrap_or_else(|| alone(&model))
        };
        let fewer = fewer.map(taught).collect();
        return Learned { best, fewer, runs, blunders };
    }
}

/// The runs linearised at their azimuths with a model, where they were linearised too far from there, and where the search goes on. Without a reference they
/// are at first at their azimuths without any effect: of what goes with the direction of the axis, or with the rate, that is not where it acts. The first step is
/// the model's own; further ones, twice as long each, are taken as long as the score rises. Far from where the runs were, the search begins anew.
fn linearised_by(model: &Model<'_>, grammar: &Grammar, azimuths: &Azimuths<'_>) -> Option<(Vec<Run>, Start)> {
    let first = model.problem.runs;
    if model.terms.is_empty() || first.iter().all(|run| run.reference.is_some() || run.still) {
        return None;
    }
    let in_runs = |runs: &[Run]| {
        let then = model.in_runs(runs)?;
        Some((then.score(grammar), azimuths(&Posterior::new(&then, &[]), runs), Start::from(&then)))
    };
    let mut runs = turned_to(first, &azimuths(&Posterior::new(model, &[]), first), 1.0);
    let (mut score, mut found, mut start) = in_runs(&runs)?;
    let mut length = 1.0;
    for _ in 0..MOST_STEPS {
        let further = turned_to(&runs, &found, length);
        match in_runs(&further).filter(|then| then.0 > score) {
            Some(then) => {
                (score, found, start) = then;
                (runs, length) = (further, 2.0 * length);
            }
            None if length > 1.0 => length = 1.0,
            None => break,
        }
    }
    let turns_deg = first.iter().zip(&runs).map(|(run, then)| wrap_180_deg(then.azimuth_deg - run.azimuth_deg));
    let turns_deg: Vec<f64> = turns_deg.collect();
    let start = if is_within(&turns_deg, LINEAR_INDEX_DEG) { start } else { Start::default() };
    (!is_within(&turns_deg, NEAR_DEG)).then_some((runs, start))
}

/// Runs without a survey on the way to these azimuths, degrees, by such a part of it. Where no run has a survey, what all of them would turn by is left out:
/// they do not know it, and an effect of the axis' direction would take it in.
fn turned_to(runs: &[Run], azimuths_deg: &[Option<f64>], part: f64) -> Vec<Run> {
    let is_asked = |run: &Run| run.reference.is_none() && !run.still;
    let turn = |(run, azimuth_deg): (&Run, &Option<f64>)| {
        Some(wrap_180_deg((*azimuth_deg)? - run.azimuth_deg)).filter(|_| is_asked(run))
    };
    let turns_deg: Vec<Option<f64>> = runs.iter().zip(azimuths_deg).map(turn).collect();
    let count = turns_deg.iter().flatten().count().max(1) as f64;
    let is_surveyed = runs.iter().any(|run| run.reference.is_some());
    let common_deg = if is_surveyed { 0.0 } else { turns_deg.iter().flatten().sum::<f64>() / count };
    let mut turned = runs.to_vec();
    for (run, turn_deg) in turned.iter_mut().zip(&turns_deg) {
        if let Some(turn_deg) = turn_deg {
            run.set_azimuth(wrap_360_deg(run.azimuth_deg + part * (turn_deg - common_deg)));
        }
    }
    rows::linearise_by_station(&mut turned);
    turned
}

/// Whether the references that a blunder is about are contradicted by the other runs, with everything that is learned then. What the best model has more
/// than the other runs show does not compete with the blunder: one run with an effect of its own is not told from one with a wrong reference. That all references are less
/// accurate than was said does.
fn contradicted(search: &Search<'_>, best: &Model<'_>, blunder: &Blunder) -> bool {
    let mended = blunder.mended(search.runs);
    let without = Search::new(&mended, search.family, Some(&search.grammar.library));
    let compared = without.best(&best.into()).and_then(|then| {
        let has_more = best.cost(&search.grammar) > then.cost(&without.grammar);
        let is_alone = has_more && best.in_runs(&mended)?.evidence() - then.evidence() <= NEGLIGIBLE;
        let seen_by_others = if is_alone { Some(then.in_runs(search.runs)?) } else { None };
        let plausible = without.plausible(&then) - blunder.cost(mended.len());
        Some(search.is_less_plausible(seen_by_others.as_ref().unwrap_or(best), plausible))
    });
    compared.unwrap_or(false)
}

/// What may be used of a model that may not be used whole: the best model with one effect or one factor less, with two less, and so on. `None` where not
/// even one effect is left.
fn with_fewer<'a>(search: &Search<'a>, whole: &Model<'a>, may_be_used: &MayBeUsed<'_>) -> Option<(Taught, Model<'a>)> {
    let mut fewer = search.with_one_less(whole);
    loop {
        let is_usable = |model: &Model<'a>| may_be_used(&Posterior::new(model, &[]), search.runs);
        if let Some(usable) = fewer.iter().position(is_usable) {
            let model = fewer.swap_remove(usable);
            return Some((Taught::usable(&model, &search.rivals(&model), search, may_be_used)?, model));
        }
        fewer = search.with_one_less(fewer.first()?);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs at 359°, 20° and 30° of which the first has a survey or none, found at 2°, 21° and 32°: turns of 3°, 1° and 2°. With the survey the others turn by 1° and 2°; without it
    /// all turn by 2° in the mean, which none of them knows, and 1°, −1° and 0° are left, half of them half of the way.
    #[test]
    fn runs_without_a_survey_turn_by_hand() {
        let found = [Some(2.0), Some(21.0), Some(32.0)];
        let unsurveyed = |azimuth_deg: f64| {
            let mut run = Run::of_rates(&[1.0; 8]);
            run.take_reference(None);
            run.set_azimuth(azimuth_deg);
            run
        };
        let mut runs = [359.0, 20.0, 30.0].map(unsurveyed);
        let at = |runs: &[Run]| runs.iter().map(|run| (1e6 * run.azimuth_deg).round() / 1e6).collect::<Vec<f64>>();
        assert_eq!(at(&turned_to(&runs, &found, 1.0)), [0.0, 19.0, 30.0]);
        assert_eq!(at(&turned_to(&runs, &found, 0.5)), [359.5, 19.5, 30.0]);
        runs[0].take_reference(Some((359.0, 0.01)));
        assert_eq!(at(&turned_to(&runs, &found, 1.0)), [359.0, 21.0, 32.0]);
    }

    /// Eight runs of eight rests of a minute, whose rates (°/h) differ by what no motion makes: an effect of the moves. A column that correlates with it by
    /// r = 0.52 over the 64 rests gains at most 32 · ln 1/(1 − r²) = 10 nats beside offsets of the rests, and hundreds beside a process that decays within the rest.
    #[test]
    fn offsets_of_rests_are_no_motion() {
        let size = |rest: usize| 20.0 * (2.4 * rest as f64).cos();
        let with_offsets = |run: usize| -> Run {
            let at = |i: usize| Run::noise(run, i) + size(8 * run + i / 60) + [10.0, 0.0, -10.0, 0.0][i % 4];
            Run::of_rests(&(0..480).map(at).collect::<Vec<f64>>(), 60)
        };
        let runs: Vec<Run> = (0..8).map(with_offsets).collect();
        let imitates = |rest: usize| 0.7 * size(rest) / 20.0 + (1.1 * (rest * rest) as f64).sin();
        let worth = gains_of(&runs, vec![(0..3840).map(|i| imitates(i / 60)).collect()]).unwrap()[0].unwrap();
        assert!(worth.log_odds < 10.0, "{worth:?}");
    }
}

//! Selection: which candidates the residual asks for, corrected for the search; their parameters with sigmas.

use rayon::prelude::*;

use super::block::Block;
use super::candidate::{Candidate, Columns};
use super::estimate::{beside, coefficients};
use super::evidence::{Predictive, homogeneity, improvement, left_out, p_value, predictive_gain, score, searched};
use super::learned::{AS_GOOD, Learned, Scored};
use super::problem::{Chosen, Problem};
use super::refine::{constant_sigma, refine, refined};
use super::statistics::chi_square_tail;

/// A candidate is taken when chance alone would do as well in fewer campaigns than this share, after paying for the search.
pub const ACCEPT: f64 = 0.01;
/// The same beside an effect that is taken already, whose shape may not be quite right.
const ACCEPT_BESIDE: f64 = 1e-3;
/// And when it predictive_gain the runs better than without by this much, twice the logarithm of odds of 20 to 1.
const PREDICTIVE_GAIN: f64 = 6.0;
/// What is left counts as structure below this probability.
pub const STRUCTURE: f64 = 1e-4;
/// A candidate that explains this share of what another of the same channel does may be the cause: sensors lag, and no
/// effect has quite the shape that it is given.
const NEARLY: f64 = 0.99;
/// A simpler form of the same cause is taken where chance alone loses as much in more campaigns than this share.
const SIMPLER: f64 = 0.01;
/// Most effects that are taken.
const MOST_EFFECTS: usize = 6;
/// Most candidates among which the predictive power decides.
const MOST_PEERS: usize = 6;
/// How often coefficients and the rates that they act on are brought into agreement.
const ROUNDS: usize = 4;
/// Where what is left has this many times the variance of noise, an effect must explain more than what stays unexplained.
const SPURIOUS_RATIO: f64 = 1.5;

/// A search among candidates.
struct Search<'a, 'b> {
    problem: Problem<'a>,
    candidates: &'b [Candidate],
    /// Columns of every candidate for every constant on its grid.
    cache: Vec<Vec<(f64, Columns)>>,
    chosen: Vec<Chosen>,
}

/// What is chosen with one candidate more.
struct Trial {
    chosen: Vec<Chosen>,
    improvement: f64,
    predictive: Predictive,
}

/// Learns from runs. `candidates` are tried one after the other until none is worth its penalty.
pub fn learn(blocks: Vec<Block<'_>>, candidates: &[Candidate]) -> Learned {
    search(blocks, candidates, |_| Vec::new())
}

/// The same; but where much more than noise is left, an effect that explains less than that may be nothing but a spurious term
/// of what no candidate is: the least of them goes, until none is.
pub fn learn_without_spurious_terms(blocks: Vec<Block<'_>>, candidates: &[Candidate]) -> Learned {
    search(blocks, candidates, Search::drop_spurious_terms)
}

fn search<'a, 'b>(
    blocks: Vec<Block<'a>>,
    candidates: &'b [Candidate],
    last: impl Fn(&mut Search<'a, 'b>) -> Vec<String>,
) -> Learned {
    let problem = Problem::new(blocks);
    let cache = candidates.par_iter().map(|candidate| columns(&problem, candidate)).collect();
    let mut search = Search { problem, candidates, cache, chosen: Vec::new() };
    let first = search.ranking(&[], search.problem.y());
    let first_left = search.problem.overdispersion(search.problem.y(), 0);
    let mut learned = Learned { first, first_left, ..Learned::default() };
    while search.chosen.len() < MOST_EFFECTS && search.take_another() {}
    search.prune();
    search.simplify();
    learned.spurious = last(&mut search);
    search.finish(&mut learned);
    learned
}

/// Whether what is left is so much more than noise that an effect may be a spurious term.
pub fn is_structure(ratio: f64, freedom: f64) -> bool {
    ratio >= SPURIOUS_RATIO && chi_square_tail(ratio * freedom, freedom) < STRUCTURE
}

fn columns(problem: &Problem, candidate: &Candidate) -> Vec<(f64, Columns)> {
    let grid = if candidate.grid.is_empty() { &[0.0][..] } else { &candidate.grid };
    grid.iter().map(|&constant| (constant, problem.projected(candidate, constant))).collect()
}

impl Search<'_, '_> {
    /// Takes the candidate that the residual asks for most; whether there was one.
    fn take_another(&mut self) -> bool {
        let basis = self.problem.basis(self.candidates, &self.chosen);
        let left = self.problem.left(&basis);
        let mut ranking = self.ranking(&basis, &left);
        ranking.sort_by(|a, b| b.score.total_cmp(&a.score));
        let Some(best) = ranking.first() else { return false };
        let best = refine(&self.problem, self.candidates, (&basis, &left), best);
        let mut peers: Vec<Scored> = ranking
            .iter()
            .skip(1)
            .take_while(|scored| scored.score > best.score - 4.0 * AS_GOOD)
            .take(MOST_PEERS)
            .map(|scored| refine(&self.problem, self.candidates, (&basis, &left), scored))
            .filter(|scored| scored.score > best.score - AS_GOOD)
            .collect();
        let words = &self.candidates[best.index];
        peers.insert(0, best);
        let mut trials: Vec<Trial> = peers.iter().map(|scored| self.trial(scored)).collect();
        // Among those that explain as much the one that predictive_gain best; in a tie the first.
        let first = (1..trials.len()).fold(0, |best, i| {
            if trials[i].predictive.gain > trials[best].predictive.gain + PREDICTIVE_GAIN { i } else { best }
        });
        // Where it does not do, the same cause in other words may.
        let related = ranking
            .iter()
            .skip(1)
            .filter(|scored| scored.score > 0.0 && self.candidates[scored.index].same_cause(words))
            .take(MOST_PEERS)
            .map(|scored| self.trial(&refine(&self.problem, self.candidates, (&basis, &left), scored)));
        let accept = if self.chosen.is_empty() { ACCEPT } else { ACCEPT_BESIDE };
        let does = |trial: &Trial| {
            // The accelerometers of every run measure its own motion: no other run has to predict it.
            let measured = trial.chosen.last().is_some_and(|&(index, _)| self.candidates[index].is_base_motion());
            (measured || trial.predictive.gain > PREDICTIVE_GAIN)
                && self.chance(&trial.chosen, trial.improvement, trial.predictive) < accept
                // Two curves in one channel have parts in common, which no fit can tell apart.
                && coefficients(&self.problem, self.candidates, &trial.chosen).is_some()
        };
        let Some(trial) = std::iter::once(trials.swap_remove(first)).chain(related).find(does) else { return false };
        self.chosen = trial.chosen;
        self.reconsider();
        self.linearise();
        true
    }

    fn trial(&self, scored: &Scored) -> Trial {
        let chosen = [self.chosen.as_slice(), &[(scored.index, scored.constant)]].concat();
        let predictive = predictive_gain(&self.problem, self.candidates, &chosen);
        Trial { chosen, improvement: scored.improvement, predictive }
    }

    /// Probability that the last of the trial explains as much by chance, or else predicts as much by chance; corrected for
    /// the search.
    fn chance(&self, trial: &[Chosen], improvement: f64, predictive: Predictive) -> f64 {
        let Some(&(index, _)) = trial.last() else { return 1.0 };
        let searched = searched(&self.candidates[index], self.candidates.len());
        let explains = p_value(&self.problem, self.candidates, trial, improvement) * searched;
        explains.min(predictive.p_value(searched))
    }

    fn ranking(&self, basis: &[Vec<f64>], left: &[f64]) -> Vec<Scored> {
        self.candidates
            .par_iter()
            .zip(&self.cache)
            .enumerate()
            .filter(|(index, _)| self.chosen.iter().all(|(taken, _)| taken != index))
            .filter_map(|(index, (candidate, columns))| {
                columns
                    .iter()
                    .map(|(constant, columns)| (*constant, improvement(basis, left, columns.clone())))
                    .max_by(|a, b| a.1.total_cmp(&b.1))
                    .map(|(constant, improvement)| Scored {
                        index,
                        constant,
                        improvement,
                        score: score(candidate, improvement, self.problem.rows()),
                    })
            })
            .collect()
    }

    /// Constants again, now that the others are there; and forms again of what acts on the rate, which is better known now.
    fn reconsider(&mut self) {
        for i in 0..self.chosen.len() {
            let (index, constant) = self.chosen[i];
            let own = &self.candidates[index];
            let (basis, left) = beside(&self.problem, self.candidates, &self.chosen, i);
            let rows = self.problem.rows();
            let related =
                |other: usize| self.candidates[other].follows_rate() && self.candidates[other].same_cause(own);
            let others =
                (0..self.candidates.len()).filter(|&other| other != index && own.follows_rate() && related(other));
            let best = std::iter::once(index)
                .chain(others)
                .map(|index| {
                    let candidate = &self.candidates[index];
                    let about = if own.follows_rate() { self.best_on_grid(candidate, &basis, &left) } else { constant };
                    let (constant, improvement) = refined(&self.problem, candidate, (&basis, &left), about);
                    (score(candidate, improvement, rows), index, constant)
                })
                .max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, index, constant)) = best {
                self.chosen[i] = (index, constant);
            }
        }
    }

    fn best_on_grid(&self, candidate: &Candidate, basis: &[Vec<f64>], left: &[f64]) -> f64 {
        let of = |constant: f64| improvement(basis, left, self.problem.projected(candidate, constant));
        let grid = candidate.grid.iter().map(|&constant| (constant, of(constant)));
        grid.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |best| best.0)
    }

    /// Brings the runs' azimuths, and the rates that some effects act on, into agreement with the effects.
    fn linearise(&mut self) {
        for _ in 0..ROUNDS {
            let Some((taken, _)) = coefficients(&self.problem, self.candidates, &self.chosen) else { return };
            self.problem.linearise(&taken);
            if !taken.iter().any(|each| each.candidate.follows_rate()) {
                break;
            }
            self.reconsider();
        }
        let problem = &self.problem;
        self.cache
            .par_iter_mut()
            .zip(self.candidates)
            .filter(|(_, candidate)| candidate.follows_rate())
            .for_each(|(cached, candidate)| *cached = columns(problem, candidate));
    }

    /// Improvement and p-value of one effect beside all the others.
    fn alone(&self, i: usize) -> (f64, f64) {
        let (index, constant) = self.chosen[i];
        let (basis, left) = beside(&self.problem, self.candidates, &self.chosen, i);
        let found = improvement(&basis, &left, self.problem.projected(&self.candidates[index], constant));
        let mut trial = self.chosen.clone();
        let own = trial.remove(i);
        trial.push(own);
        (found, self.chance(&trial, found, predictive_gain(&self.problem, self.candidates, &trial)))
    }

    /// Effects that later ones made superfluous go.
    fn prune(&mut self) {
        loop {
            let worst = (0..self.chosen.len()).map(|i| (i, self.alone(i).1)).max_by(|a, b| a.1.total_cmp(&b.1));
            match worst {
                Some((i, p_value)) if p_value >= ACCEPT => {
                    self.chosen.remove(i);
                }
                _ => return,
            }
        }
    }

    /// Effects take the simplest form of the same cause that the data do not contradict.
    fn simplify(&mut self) {
        for i in 0..self.chosen.len() {
            let (index, constant) = self.chosen[i];
            let own = &self.candidates[index];
            let (basis, left) = beside(&self.problem, self.candidates, &self.chosen, i);
            let full = improvement(&basis, &left, self.problem.projected(own, constant));
            let all = self.problem.basis(self.candidates, &self.chosen);
            let (ratio, _) = self.problem.overdispersion(&self.problem.left(&all), all.len());
            let simpler = (0..self.candidates.len())
                .filter(|&other| {
                    let other = &self.candidates[other];
                    other.freedom() < own.freedom() && other.grid.is_empty() && other.same_cause(own)
                })
                .filter(|&other| {
                    let other = &self.candidates[other];
                    let fall = full - improvement(&basis, &left, self.problem.projected(other, 0.0));
                    chi_square_tail(fall / ratio.max(1.0), (own.freedom() - other.freedom()) as f64) > SIMPLER
                })
                .min_by_key(|&other| self.candidates[other].freedom());
            if let Some(simpler) = simpler {
                self.chosen[i] = (simpler, 0.0);
            }
        }
    }

    /// Drops spurious terms; their names.
    fn drop_spurious_terms(&mut self) -> Vec<String> {
        let mut gone = Vec::new();
        loop {
            let basis = self.problem.basis(self.candidates, &self.chosen);
            let (ratio, freedom) = self.problem.overdispersion(&self.problem.left(&basis), basis.len());
            if !is_structure(ratio, freedom) {
                return gone;
            }
            let least = (0..self.chosen.len()).map(|i| (i, self.alone(i).0)).min_by(|a, b| a.1.total_cmp(&b.1));
            match least {
                Some((i, improvement)) if improvement < (ratio - 1.0) * freedom => {
                    gone.push(self.candidates[self.chosen.remove(i).0].full_name());
                    self.linearise();
                }
                _ => return gone,
            }
        }
    }

    fn finish(&self, learned: &mut Learned) {
        let basis = self.problem.basis(self.candidates, &self.chosen);
        let left = self.problem.left(&basis);
        (learned.left, learned.left_freedom) = self.problem.overdispersion(&left, basis.len());
        let Some((mut taken, mut covariance)) = coefficients(&self.problem, self.candidates, &self.chosen) else {
            return;
        };
        // Where more than white noise is left, the parameters are as much less certain.
        let inflation = learned.left.max(1.0);
        covariance.iter_mut().flatten().for_each(|value| *value *= inflation);
        for (i, each) in taken.iter_mut().enumerate() {
            each.sigmas.iter_mut().for_each(|sigma| *sigma *= inflation.sqrt());
            (each.improvement, each.p_value) = self.alone(i);
            each.constant_sigma = constant_sigma(&self.problem, self.candidates, &self.chosen, i) * inflation.sqrt();
            each.alternatives = self.alternatives(i);
        }
        learned.taken = taken;
        learned.covariance = covariance;
        learned.left_out = left_out(&self.problem, self.candidates, &self.chosen);
        let (fall, free) = homogeneity(&self.problem, self.candidates, &self.chosen);
        learned.sameness_p_value = chi_square_tail(fall, free);
    }

    /// Candidates that would explain as much in the place of effect `i`.
    fn alternatives(&self, i: usize) -> Vec<(Candidate, f64)> {
        let (index, constant) = self.chosen[i];
        let own = &self.candidates[index];
        let (basis, left) = beside(&self.problem, self.candidates, &self.chosen, i);
        let improvement = improvement(&basis, &left, self.problem.projected(own, constant));
        let own_score = score(own, improvement, self.problem.rows());
        let nearly = |scored: &Scored| {
            let channel = &self.candidates[scored.index].channel;
            channel.is_some() && *channel == own.channel && scored.improvement > NEARLY * improvement
        };
        let mut found: Vec<Scored> = self
            .ranking(&basis, &left)
            .into_iter()
            .filter(|scored| !self.candidates[scored.index].same_cause(own))
            .filter(|scored| scored.score > own_score - 4.0 * AS_GOOD || nearly(scored))
            .map(|scored| refine(&self.problem, self.candidates, (&basis, &left), &scored))
            .filter(|scored| scored.score > own_score - AS_GOOD || nearly(scored))
            .collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found.into_iter().map(|scored| (self.candidates[scored.index].clone(), scored.constant)).collect()
    }
}

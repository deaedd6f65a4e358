//! How a unit has the effects of its family: by what its runs, or the model that was learned from them, say of the weights.
//!
//! Runs speak of weights w by the inner products of columns G = Φᵀ V⁻¹ Φ and Φᵀ V⁻¹ y; a posterior N(μ, C) is the same with G = C⁻¹ and C⁻¹ μ. Of
//! these small numbers the evidence of every hypothesis follows exactly, whatever the prior N(m, R Rᵀ) of the weights.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::Effect;

use super::family::{Common, Prior, Way};
use super::functions::{Library, Values};
use super::problem::Problem;
use super::rows::Run;

/// What the directions of a model file leave out of a weight's variance: it is known to this share of itself at best.
const KNOWN_TO: f64 = 0.02;

/// What one unit says of the weights of some effects, in units of the weights' priors.
#[derive(Clone, Debug)]
pub struct Statistics {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    counts: Vec<usize>,
    /// Effects of which nothing is known that could be weighed: a model file does not hold what was not found.
    silent: Vec<bool>,
}

/// Hypotheses of one effect.
#[derive(Clone, Debug)]
pub struct Ways {
    /// Number of the effect in the statistics.
    pub effect: usize,
    pub family: Prior,
    pub own: Prior,
}

impl Ways {
    pub fn new(effect: usize, common: &Common) -> Self {
        Self { effect, family: common.prior(Way::Family), own: common.prior(Way::Own) }
    }

    /// Probability that a unit which lacks the effect does not follow the family in it: half of those outside lack it.
    fn outside_if_absent(&self) -> f64 {
        // Costs are over absence: e^-cost of the own way is half the share outside, over the probability of absence.
        (-self.own.cost).exp().min(1.0)
    }

    fn prior(&self, way: Way) -> &Prior {
        match way {
            Way::Family => &self.family,
            Way::Own => &self.own,
        }
    }
}

/// How a unit has one effect.
#[derive(Clone, Debug)]
pub struct Place {
    /// Probabilities that it has it as the family, in a way of its own, or not.
    pub family: f64,
    pub own: f64,
    pub absent: f64,
    /// Mean and covariance of its weights if it has it as the family, in units of their priors.
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Mean of its weights in the likeliest way; 0 where it lacks the effect.
    pub likeliest: DVector<f64>,
    /// Logarithm of the odds of both ways together over absence, nats.
    pub log_odds: f64,
}

/// What some hypotheses come to.
struct Taught {
    /// Log evidence over that of no effect.
    log: f64,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Statistics {
    /// Of runs with a process of their own.
    pub fn of_runs(runs: &[Run], process: Option<&Process>, effects: &[Effect]) -> Self {
        let problem = Problem::new(runs, process);
        let library = Library::new(runs);
        let values: Values = effects.iter().flat_map(|effect| library.values(runs, effect)).collect();
        let columns = problem.columns(&values);
        Self {
            gram: columns.squares(),
            right: columns.scores(&problem.residual),
            counts: effects.iter().map(Effect::count).collect(),
            silent: vec![false; effects.len()],
        }
    }

    /// Of a posterior: effects among `effects` by their numbers, in the order of the weights of mean and covariance, in units of their priors.
    pub fn of_posterior(effects: &[Effect], known: &[usize], mean: &DVector<f64>, covariance: &DMatrix<f64>) -> Self {
        let counts: Vec<usize> = effects.iter().map(Effect::count).collect();
        let places: Vec<usize> = known.iter().flat_map(|&number| span(&counts, number)).collect();
        let total = counts.iter().sum();
        let mut floored = covariance.clone();
        for i in 0..mean.len() {
            floored[(i, i)] += (KNOWN_TO * mean[i]).powi(2) + 1e-12;
        }
        let (mut gram, mut right) = (DMatrix::zeros(total, total), DVector::zeros(total));
        if let Some(inverse) = floored.try_inverse() {
            let own = &inverse * mean;
            for (i, &row) in places.iter().enumerate() {
                right[row] = own[i];
                for (j, &column) in places.iter().enumerate() {
                    gram[(row, column)] = inverse[(i, j)];
                }
            }
        }
        let silent = (0..counts.len()).map(|number| !known.contains(&number)).collect();
        Self { gram, right, counts, silent }
    }

    /// Of effects by their numbers, each with its prior.
    fn taught(&self, chosen: &[(usize, &Prior)]) -> Option<Taught> {
        let places: Vec<usize> = chosen.iter().flat_map(|(number, _)| span(&self.counts, *number)).collect();
        let count = places.len();
        let gram = DMatrix::from_fn(count, count, |i, j| self.gram[(places[i], places[j])]);
        let right = DVector::from_fn(count, |i, _| self.right[places[i]]);
        let (mut mean, mut root, mut first) = (DVector::zeros(count), DMatrix::zeros(count, count), 0);
        for (_, prior) in chosen {
            let own = prior.mean.len();
            mean.rows_mut(first, own).copy_from(&prior.mean);
            root.view_mut((first, first), (own, own)).copy_from(&prior.root);
            first += own;
        }
        let pulled = &gram * &mean;
        let factor = (DMatrix::identity(count, count) + root.transpose() * &gram * &root).cholesky()?;
        let half = root.transpose() * (&right - &pulled);
        let inner = factor.solve(&half);
        let log = right.dot(&mean) - 0.5 * mean.dot(&pulled) + 0.5 * half.dot(&inner)
            - factor.l_dirty().diagonal().map(f64::ln).sum();
        Some(Taught { log, mean: mean + &root * inner, covariance: &root * factor.inverse() * root.transpose() })
    }

    /// Log odds of an effect with weights of any size beside others that the unit has in these ways, and the mean and the covariance of its weights then.
    pub fn alone(&self, effect: usize, beside: &[(&Ways, Way)]) -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        if self.silent[effect] {
            return None;
        }
        let mut chosen: Vec<(usize, &Prior)> =
            beside.iter().map(|(ways, way)| (ways.effect, ways.prior(*way))).collect();
        let without = self.taught(&chosen)?.log;
        let own = span(&self.counts, effect);
        let count = own.len();
        let information = own.map(|i| self.gram[(i, i)]).fold(0.0, f64::max);
        // From a third of the error of a weight to ten thousand errors.
        let sized = |power: i32| {
            let size = (10f64.powf(-1.0 + 0.5 * f64::from(power)) / information).sqrt();
            Prior { mean: DVector::zeros(count), root: DMatrix::identity(count, count) * size, cost: 0.0 }
        };
        let sizes: Vec<Prior> = (0..=18).map(sized).collect();
        let mut best: Option<(f64, DVector<f64>, DMatrix<f64>)> = None;
        for prior in &sizes {
            chosen.push((effect, prior));
            let with = self.taught(&chosen)?;
            chosen.pop();
            let first = with.mean.len() - count;
            let log = with.log - without;
            if best.as_ref().is_none_or(|best| log > best.0) {
                let covariance = with.covariance.view((first, first), (count, count)).into_owned();
                best = Some((log, with.mean.rows(first, count).into_owned(), covariance));
            }
        }
        best
    }

    /// How the unit has one effect, beside others that it has in these ways.
    pub fn place(&self, ways: &Ways, beside: &[(&Ways, Way)]) -> Option<Place> {
        let count = self.counts[ways.effect];
        let nothing = || Place {
            family: 0.0,
            own: 0.0,
            absent: 1.0,
            mean: DVector::zeros(count),
            covariance: DMatrix::zeros(count, count),
            likeliest: DVector::zeros(count),
            log_odds: f64::NEG_INFINITY,
        };
        if self.silent[ways.effect] {
            return Some(nothing());
        }
        let mut chosen: Vec<(usize, &Prior)> =
            beside.iter().map(|(ways, way)| (ways.effect, ways.prior(*way))).collect();
        let without = self.taught(&chosen)?.log;
        let mut of = |prior| {
            chosen.push((ways.effect, prior));
            let taught = self.taught(&chosen);
            chosen.pop();
            taught
        };
        let (family, own) = (of(&ways.family)?, of(&ways.own)?);
        let logs = [family.log - without - ways.family.cost, own.log - without - ways.own.cost, 0.0];
        let most = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let whole: f64 = logs.iter().map(|log| (log - most).exp()).sum();
        let [in_family, of_its_own, absent] = logs.map(|log| (log - most).exp() / whole);
        let first = family.mean.len() - count;
        let weights = |taught: &Taught| taught.mean.rows(first, count).into_owned();
        let likeliest = if absent > 0.5 {
            DVector::zeros(count)
        } else if in_family > of_its_own {
            weights(&family)
        } else {
            weights(&own)
        };
        Some(Place {
            family: in_family,
            own: of_its_own,
            absent,
            mean: weights(&family),
            covariance: family.covariance.view((first, first), (count, count)).into_owned(),
            likeliest,
            log_odds: most + (whole - (-most).exp()).max(f64::MIN_POSITIVE).ln(),
        })
    }

    /// In which ways the unit has these effects, by turns until none changes.
    pub fn likeliest<'a>(&self, all: &'a [Ways]) -> Vec<(&'a Ways, Way)> {
        let mut states: Vec<Option<Way>> = vec![None; all.len()];
        let beside = |states: &[Option<Way>], but: usize| -> Vec<(&'a Ways, Way)> {
            let others = all.iter().zip(states).enumerate().filter(|(i, _)| *i != but);
            others.filter_map(|(_, (ways, state))| Some((ways, (*state)?))).collect()
        };
        // Each turn takes the change that raises the evidence most, so that there are no more than the effects have ways.
        for _ in 0..3 * all.len() {
            let change = |(i, ways): (usize, &'a Ways)| {
                let place = self.place(ways, &beside(&states, i))?;
                let options = [(place.family, Some(Way::Family)), (place.own, Some(Way::Own)), (place.absent, None)];
                let now = options.iter().find(|(_, way)| *way == states[i])?.0;
                let (best, way) = options.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
                (way != states[i]).then(|| ((best / now.max(1e-300)).ln(), i, way))
            };
            let best = all.iter().enumerate().filter_map(change).max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((_, i, way)) => states[i] = way,
                None => break,
            }
        }
        beside(&states, all.len())
    }

    /// How the unit has each of these effects, beside the others in their likeliest ways.
    pub fn places(&self, all: &[Ways]) -> Vec<Option<Place>> {
        let likeliest = self.likeliest(all);
        let of = |ways: &Ways| {
            let beside: Vec<(&Ways, Way)> =
                likeliest.iter().filter(|(other, _)| other.effect != ways.effect).copied().collect();
            self.place(ways, &beside)
        };
        all.iter().map(of).collect()
    }
}

/// Whether a unit is like its family, and in what it is not.
#[derive(Clone, Debug)]
pub struct Standing {
    /// How it has each of the family's effects.
    pub places: Vec<Option<Place>>,
    /// Probabilities of further effects.
    pub others: Vec<f64>,
    /// Probability that it does not follow the family in some effect, or has another one.
    pub outside: f64,
}

impl Standing {
    /// Of what a unit says of the family's effects and of others that it has by itself: their numbers, and what their forms cost.
    pub fn new(unit: &Statistics, family: &[Ways], others: &[(usize, f64)]) -> Self {
        let likeliest = unit.likeliest(family);
        let places = unit.places(family);
        let other = |(number, cost): &(usize, f64)| {
            unit.alone(*number, &likeliest).map_or(0.0, |(log_odds, ..)| 1.0 / (1.0 + (cost - log_odds).exp()))
        };
        let others: Vec<f64> = others.iter().map(other).collect();
        let follows = |(ways, place): (&Ways, &Option<Place>)| {
            place.as_ref().map_or(1.0, |place| 1.0 - place.own - place.absent * ways.outside_if_absent())
        };
        let inside: f64 = family.iter().zip(&places).map(follows).product::<f64>()
            * others.iter().map(|probability| 1.0 - probability).product::<f64>();
        Self { places, others, outside: 1.0 - inside }
    }
}

/// Places of the weights of an effect among those of all.
fn span(counts: &[usize], number: usize) -> std::ops::Range<usize> {
    let first: usize = counts[..number].iter().sum();
    first..first + counts[number]
}

#[cfg(test)]
mod tests {
    use north_finder::effects::effect::Port;

    use super::*;

    fn scale(mean: f32, sigma: f64, share: f64) -> Common {
        let mut effect = Effect::new(Port::Scale, &[]);
        effect.weights.copy_from_slice(&[mean]);
        Common {
            effect,
            share,
            units: 10.0,
            covariance: DMatrix::from_element(1, 1, sigma * sigma),
            spreads: Vec::new(),
        }
    }

    /// One weight, known to ± 1 by the runs. The family has 10 ± 2: a unit that reads 11 has 10 + 1 · 4/5 = 10.8 as the family, with variance 4/5. One
    /// that reads −25 is of its own kind: 35/√5 sigma of the family. One that reads 0.3 has none of it.
    #[test]
    fn a_unit_like_the_others_and_two_that_are_not() {
        let common = scale(10.0, 2.0, 0.8);
        let ways = [Ways::new(0, &common)];
        let place = |reads: f64| {
            let one = DMatrix::from_element(1, 1, 1.0);
            let mut statistics = Statistics::of_posterior(
                std::slice::from_ref(&common.effect),
                &[0],
                &DVector::from_element(1, reads),
                &one,
            );
            // Without what a model file's directions may leave out.
            statistics.gram = one;
            statistics.right = DVector::from_element(1, reads);
            statistics.places(&ways).remove(0).unwrap()
        };
        let like = place(11.0);
        assert!(
            like.family > 0.99 && (like.mean[0] - 10.8).abs() < 1e-9 && (like.covariance[(0, 0)] - 0.8).abs() < 1e-9
        );
        let unlike = place(-25.0);
        assert!(unlike.own > 0.99 && unlike.likeliest[0] < -24.0, "{unlike:?}");
        let without = place(0.3);
        assert!(without.absent > 0.95 && without.likeliest[0] == 0.0, "{without:?}");
    }
}

//! A family from its units, by expectation and maximisation: the share of units that have an effect, mean and covariance of its weights.
//!
//! Effects are taken up one after the other, as long as the evidence of all units together grows by more than the effect costs; so an effect that no
//! single unit is certain of may be certain of all, and one that a single unit has by chance is not.

use learn::{Common, Place, Statistics, Way, Ways, asked_beside, form_cost};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidates::Candidate;

/// Rounds of expectation and maximisation: of one effect beside the others, and of all.
const ROUNDS: usize = 12;
/// Log odds from which on a unit has an effect, for a first estimate; nats.
const HAS_IT: f64 = 3.0;
/// What is known beforehand of the covariance weighs as much as so many units, and is a spread of this share of the mean: coefficients of instruments
/// of one type spread by a tenth to a third of their mean.
const PRIOR_UNITS: f64 = 2.0;
const USUAL_SPREAD: f64 = 0.2;
/// One unit is no family.
const LEAST_UNITS: f64 = 2.0;

/// What the units make of an effect under one prior.
struct Expected {
    places: Vec<Option<Place>>,
}

/// Numbers of the candidates that are the family's, with what the units have in common of each.
pub fn mixture(units: &[Statistics], candidates: &[Candidate], signals: usize) -> Vec<(usize, Common)> {
    let mut family: Vec<(usize, Common)> = Vec::new();
    loop {
        let beside: Vec<Ways> = family.iter().map(|(number, common)| Ways::new(*number, common)).collect();
        let states: Vec<Vec<(&Ways, Way)>> = units.par_iter().map(|unit| unit.likeliest(&beside)).collect();
        let missing: Vec<usize> =
            (0..candidates.len()).filter(|number| !family.iter().any(|(known, _)| known == number)).collect();
        let best = missing
            .into_par_iter()
            .filter_map(|number| {
                let (gain, common) = alone(units, &states, number, &candidates[number])?;
                Some((gain - cost(&candidates[number], units.len(), signals), number, common))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        // Of fleets without any effect one is taken up by chance in as many as of single instruments.
        match best {
            Some((gain, number, common)) if gain > asked_beside(family.len()) => {
                family.push((number, common));
                family = together(units, family);
            }
            _ => return family,
        }
    }
}

/// What an effect costs, nats: its form, and half a logarithm of the number of units for its share and each mean and variance (Schwarz 1978).
fn cost(candidate: &Candidate, units: usize, signals: usize) -> f64 {
    let parameters = 1.0 + 2.0 * candidate.effect.count() as f64;
    form_cost(&candidate.effect, signals) + 0.5 * parameters * (units.max(2) as f64).ln()
}

/// One effect beside those that the units have: the evidence that all units gain by it, and what they have in common of it.
fn alone(
    units: &[Statistics],
    states: &[Vec<(&Ways, Way)>],
    number: usize,
    candidate: &Candidate,
) -> Option<(f64, Common)> {
    let first: Vec<(f64, DVector<f64>, DMatrix<f64>)> = units
        .iter()
        .zip(states)
        .filter_map(|(unit, beside)| unit.alone(number, beside))
        .filter(|each| each.0 > HAS_IT)
        .collect();
    let weights: Vec<(f64, &DVector<f64>, &DMatrix<f64>)> = first.iter().map(|(_, mean, of)| (1.0, mean, of)).collect();
    let mut common = maximised(candidate, &weights, units.len())?;
    for _ in 0..ROUNDS {
        let expected = expected(units, states, number, &common);
        common = maximised(candidate, &expected.weights(), units.len())?;
    }
    let expected = expected(units, states, number, &common);
    // The odds are over absence, whose probability falls as the share grows.
    let ways = Ways::new(number, &common);
    let absent = -((ways.family.cost).exp().recip() + ways.own.cost.exp().recip()).ln_1p();
    let gain = expected.places.iter().flatten().map(|place| absent + softplus(place.log_odds)).sum();
    (common.units >= LEAST_UNITS).then_some((gain, common))
}

/// ln(1 + eˣ).
fn softplus(x: f64) -> f64 {
    if x > 30.0 { x } else { x.exp().ln_1p() }
}

fn expected(units: &[Statistics], states: &[Vec<(&Ways, Way)>], number: usize, common: &Common) -> Expected {
    let ways = Ways::new(number, common);
    Expected { places: units.iter().zip(states).map(|(unit, beside)| unit.place(&ways, beside)).collect() }
}

impl Expected {
    /// Probability that a unit has it as the family, and its weights then.
    fn weights(&self) -> Vec<(f64, &DVector<f64>, &DMatrix<f64>)> {
        self.places.iter().flatten().map(|place| (place.family, &place.mean, &place.covariance)).collect()
    }
}

/// All effects of the family by turns, until they settle.
fn together(units: &[Statistics], mut family: Vec<(usize, Common)>) -> Vec<(usize, Common)> {
    for _ in 0..ROUNDS {
        let ways: Vec<Ways> = family.iter().map(|(number, common)| Ways::new(*number, common)).collect();
        let places: Vec<Vec<Option<Place>>> = units.par_iter().map(|unit| unit.places(&ways)).collect();
        let with = |(i, (number, common)): (usize, &(usize, Common))| {
            let of = Expected { places: places.iter().map(|unit| unit[i].clone()).collect() };
            let better = maximised(&Candidate::known(common), &of.weights(), units.len())
                .filter(|common| common.units >= LEAST_UNITS)?;
            Some((*number, better))
        };
        family = family.iter().enumerate().filter_map(with).collect();
    }
    family
}

/// Share, mean and covariance of what units have with these probabilities: sums of the first and second moments of their posteriors (Dempster, Laird and
/// Rubin 1977), the covariance with a weak prior.
fn maximised(candidate: &Candidate, weights: &[(f64, &DVector<f64>, &DMatrix<f64>)], units: usize) -> Option<Common> {
    let count = candidate.effect.count();
    let whole: f64 = weights.iter().map(|(probability, ..)| probability).sum();
    if !(whole > 1e-3) {
        return None;
    }
    let mean =
        weights.iter().fold(DVector::zeros(count), |sum, (probability, mean, _)| sum + *mean * *probability) / whole;
    let mut squares = DMatrix::zeros(count, count);
    for (probability, own, covariance) in weights {
        let off = *own - &mean;
        squares += (*covariance + &off * off.transpose()) * *probability;
    }
    let size2 = (squares.trace() / whole + mean.norm_squared()) / count as f64;
    let usual = DMatrix::identity(count, count) * (USUAL_SPREAD * USUAL_SPREAD * size2);
    let covariance = (squares + usual * PRIOR_UNITS) / (whole + PRIOR_UNITS);
    let mut effect = candidate.effect.clone();
    let priors: Vec<f64> = (0..count).map(|number| effect.prior(number)).collect();
    effect
        .weights
        .iter_mut()
        .zip(mean.iter().zip(&priors))
        .for_each(|(weight, (mean, prior))| *weight = (mean * prior) as f32);
    Some(Common {
        effect,
        // Of a share nobody knows anything beforehand (Laplace).
        share: (whole + 1.0) / (units as f64 + 2.0),
        units: whole,
        covariance: DMatrix::from_fn(count, count, |i, j| priors[i] * covariance[(i, j)] * priors[j]),
        spreads: candidate.spreads.clone(),
    })
}

//! What was learned as one posterior: the likely models together, for the model file.
//!
//! Models that are about as likely as the best are averaged: the weights of all their effects together have the mean and the covariance of the mixture,
//! so that alternatives which this campaign cannot tell apart stand in sigma. Nobody knows beforehand how much likelier one form is than another: up to
//! the odds for which a further effect is asked, the runs have not decided, and the alternatives count alike.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::Effect;

use super::model::{Model, NEGLIGIBLE};
use super::search::{FURTHER_FALSE_DISCOVERIES, is_writable};

/// One of the likely models.
#[derive(Clone, Debug)]
pub struct Alternative {
    pub effects: Vec<Effect>,
    /// Its probability among those that are kept.
    pub probability: f64,
    pub process: Option<Process>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// Effects with their weights, and how uncertain these are.
#[derive(Clone, Debug, Default)]
pub struct Posterior {
    pub effects: Vec<Effect>,
    /// Covariance of all weights, in the same order.
    pub covariance: DMatrix<f64>,
    pub process: Option<Process>,
    /// The effects of the best model alone, with their weights in it.
    pub likeliest: Vec<Effect>,
    /// The best model first, then those that may be true in its place, the likelier first.
    pub alternatives: Vec<Alternative>,
}

impl Posterior {
    /// Of a search's best model and its rivals.
    pub fn new(best: &Model<'_>, rivals: &[Model<'_>]) -> Self {
        let mut near: Vec<(f64, &Model<'_>)> = rivals.iter().map(|rival| (rival.log_odds_over(best), rival)).collect();
        near.retain(|(log_odds, _)| *log_odds > -NEGLIGIBLE);
        near.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rivals = near.into_iter().map(|(log_odds, rival)| Alternative::new(rival, undecided(log_odds)));
        let mut alternatives: Vec<Alternative> = std::iter::once(Alternative::new(best, 1.0)).chain(rivals).collect();
        let effects = union(&mut alternatives);
        let whole: f64 = alternatives.iter().map(|each| each.probability).sum();
        alternatives.iter_mut().for_each(|each| each.probability /= whole);
        let (mean, covariance) = moments(&effects, &alternatives);
        let likeliest = alternatives.first().map_or(Vec::new(), |best| weighted(best.effects.clone(), &best.mean));
        Self { effects: weighted(effects, &mean), covariance, process: best.process, likeliest, alternatives }
    }
}

/// How much a rival of so many log odds over the best model counts, the best one as 1.
fn undecided(log_odds: f64) -> f64 {
    (log_odds - FURTHER_FALSE_DISCOVERIES.ln()).exp().min(1.0)
}

impl Alternative {
    fn new(model: &Model<'_>, probability: f64) -> Self {
        let priors: Vec<f64> =
            model.terms.iter().flat_map(|term| (0..term.effect.count()).map(|k| term.effect.prior(k))).collect();
        let (scaled_mean, scaled) = model.weights();
        let mean = DVector::from_fn(priors.len(), |i, _| scaled_mean[i] * priors[i]);
        let covariance = DMatrix::from_fn(priors.len(), priors.len(), |i, j| priors[i] * scaled[(i, j)] * priors[j]);
        let effects = model.terms.iter().map(|term| term.effect.clone()).collect();
        Self { effects, probability, process: model.process, mean, covariance }
    }

    /// Place of each of its weights among those of all effects.
    fn places(&self, all: &[Effect]) -> Vec<usize> {
        let first = |effect: &Effect| -> usize {
            let before = all.iter().take_while(|each| *each != effect);
            before.map(Effect::count).sum()
        };
        self.effects.iter().flat_map(|effect| (first(effect)..).take(effect.count())).collect()
    }
}

/// The effects of all alternatives, in their order; alternatives that find no room go.
fn union(alternatives: &mut Vec<Alternative>) -> Vec<Effect> {
    let mut effects: Vec<Effect> = Vec::new();
    alternatives.retain(|each| {
        let further = each.effects.iter().filter(|effect| !effects.contains(effect));
        let together: Vec<Effect> = effects.iter().chain(further).cloned().collect();
        let fits = is_writable(&together);
        if fits {
            effects = together;
        }
        fits
    });
    effects
}

/// Mean and covariance of the mixture: Σ p (C + (m − m̄)(m − m̄)ᵀ).
fn moments(effects: &[Effect], alternatives: &[Alternative]) -> (DVector<f64>, DMatrix<f64>) {
    let count = effects.iter().map(Effect::count).sum();
    let spread = |each: &Alternative| {
        let mut mean = DVector::zeros(count);
        each.places(effects).into_iter().zip(each.mean.iter()).for_each(|(place, value)| mean[place] = *value);
        mean
    };
    let means: Vec<DVector<f64>> = alternatives.iter().map(spread).collect();
    let mean =
        means.iter().zip(alternatives).fold(DVector::zeros(count), |sum, (mean, each)| sum + mean * each.probability);
    let mut covariance = DMatrix::zeros(count, count);
    for (own, each) in means.iter().zip(alternatives) {
        let places = each.places(effects);
        for (i, &row) in places.iter().enumerate() {
            for (j, &column) in places.iter().enumerate() {
                covariance[(row, column)] += each.probability * each.covariance[(i, j)];
            }
        }
        let away = own - &mean;
        covariance += &away * away.transpose() * each.probability;
    }
    (mean, covariance)
}

fn weighted(mut effects: Vec<Effect>, mean: &DVector<f64>) -> Vec<Effect> {
    let mut first = 0;
    for effect in &mut effects {
        effect.weights.iter_mut().zip(mean.iter().skip(first)).for_each(|(weight, mean)| *weight = *mean as f32);
        first += effect.count();
    }
    effects
}

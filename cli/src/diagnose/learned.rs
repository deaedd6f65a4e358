//! What was learned: the effects that were taken, with coefficients, constants and sigmas.

use std::collections::BTreeMap;

use north_finder::effects::{ErrorModel, TooMany};

use super::candidate::Candidate;

/// Candidates whose score (in noise variances) is within this of the chosen one's explain the campaign as well: odds of
/// e^(9.2/2) = 100 to 1.
pub const AS_GOOD: f64 = 9.2;

/// An effect with its constant and coefficients.
#[derive(Clone, Debug)]
pub struct Taken {
    pub candidate: Candidate,
    pub constant: f64,
    pub coefficients: Vec<f64>,
    pub sigmas: Vec<f64>,
    pub constant_sigma: f64,
    pub improvement: f64,
    pub p_value: f64,
    /// Candidates that explain as much in its place, with their constants.
    pub alternatives: Vec<(Candidate, f64)>,
    /// Share of the evidence that lies in the surveyed headings.
    pub by_references: f64,
}

/// A candidate's scored at one stage.
#[derive(Clone, Debug)]
pub struct Scored {
    pub index: usize,
    pub constant: f64,
    /// Fall of the weighted sum of squares.
    pub improvement: f64,
    pub score: f64,
}

/// What was learned.
#[derive(Clone, Debug, Default)]
pub struct Learned {
    pub taken: Vec<Taken>,
    /// Covariance of all coefficients, in the order of the effects.
    pub covariance: Vec<Vec<f64>>,
    /// Coefficients as the other runs give them, by the file of the run that is left out; none where they cannot be told.
    pub left_out: BTreeMap<String, Vec<f64>>,
    /// Each candidate's scored before anything was taken.
    pub first: Vec<Scored>,
    /// Variance of what is left over blocks of seconds, in units of white noise, and its degrees of freedom.
    pub left: f64,
    pub left_freedom: f64,
    /// The same before anything was taken.
    pub first_left: (f64, f64),
    /// Probability that effects which are the same in every run differ as much from run to run.
    pub sameness_p_value: f64,
    /// Effects that were let go because more is left than they explain.
    pub spurious: Vec<String>,
}

impl Learned {
    /// Forgets all effects; what is left is again what it was before them.
    pub fn give_back(&mut self) {
        let (first, first_left) = (std::mem::take(&mut self.first), self.first_left);
        *self = Self { first, first_left, left: first_left.0, left_freedom: first_left.1, ..Self::default() };
    }

    /// Forgets the other effects.
    pub fn keep(&mut self, wanted: impl Fn(&Taken) -> bool) {
        let keep: Vec<bool> = self
            .taken
            .iter()
            .flat_map(|each| each.coefficients.iter().map(|_| wanted(each)).collect::<Vec<_>>())
            .collect();
        let kept = |values: &mut Vec<f64>| {
            let mut flags = keep.iter();
            values.retain(|_| flags.next().copied().unwrap_or(false));
        };
        let mut flags = keep.iter();
        self.covariance.retain(|_| flags.next().copied().unwrap_or(false));
        self.covariance.iter_mut().chain(self.left_out.values_mut()).for_each(kept);
        self.taken.retain(wanted);
    }

    /// The error model with the effects in it, over `base`.
    pub fn model(&self, base: &ErrorModel) -> Result<ErrorModel, TooMany> {
        self.model_with(base, &self.taken.iter().flat_map(|each| each.coefficients.clone()).collect::<Vec<_>>())
    }

    /// The same with other coefficients.
    pub fn model_with(&self, base: &ErrorModel, coefficients: &[f64]) -> Result<ErrorModel, TooMany> {
        let mut model = base.clone();
        let mut rest = coefficients;
        for each in &self.taken {
            let (own, others) = rest.split_at(each.coefficients.len());
            rest = others;
            each.candidate.put(each.constant, own, &mut model)?;
        }
        Ok(model)
    }
}

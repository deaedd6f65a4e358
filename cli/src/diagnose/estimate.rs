//! The chosen effects together: coefficients, constants, their sigmas, and what would explain as much.

use north_finder::effects::ErrorModel;

use super::candidate::{Candidate, Columns, Shape};
use super::evidence::{by_references, improvement, score};
use super::problem::{Chosen, Problem};
use super::statistics::least_squares;

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
    pub rivals: Vec<(Candidate, f64)>,
    /// Share of the evidence that lies in the surveyed headings.
    pub by_references: f64,
}

/// A candidate's merit at one stage.
#[derive(Clone, Debug)]
pub struct Merit {
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
    /// Each candidate's merit before anything was taken.
    pub first: Vec<Merit>,
    /// Variance of what is left over blocks of seconds, in units of white noise.
    pub left: f64,
    pub left_freedom: f64,
    /// Probability that effects which are the same in every run differ as much from run to run.
    pub sameness_p_value: f64,
    /// Effects that were let go because more is left than they explain.
    pub shadows: Vec<String>,
}

impl Learned {
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
        self.covariance.iter_mut().for_each(kept);
        self.taken.retain(wanted);
    }

    /// The error model with the effects in it, over `base`.
    pub fn model(&self, base: &ErrorModel) -> ErrorModel {
        self.model_with(base, &self.taken.iter().flat_map(|each| each.coefficients.clone()).collect::<Vec<_>>())
    }

    /// The same with other coefficients.
    pub fn model_with(&self, base: &ErrorModel, coefficients: &[f64]) -> ErrorModel {
        let mut model = base.clone();
        let mut rest = coefficients;
        for each in &self.taken {
            let (own, others) = rest.split_at(each.coefficients.len());
            rest = others;
            match (&each.candidate.shape, each.candidate.term(each.constant, own)) {
                // The solver takes the accelerometers' measure of a slow creep out by itself.
                (Shape::BaseMotion, _) => {}
                (_, Some(term)) => {
                    let _ = model.terms.push(term);
                }
                (_, None) => model.scale_error += own.first().copied().unwrap_or(0.0),
            }
        }
        model
    }
}

/// Joint least squares of the chosen effects: these, and the covariance of their coefficients. `None` where they cannot be
/// told apart at all.
pub fn coefficients(
    problem: &Problem,
    candidates: &[Candidate],
    chosen: &[Chosen],
) -> Option<(Vec<Taken>, Vec<Vec<f64>>)> {
    let columns: Vec<Columns> =
        chosen.iter().map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let flat: Vec<&[f64]> = columns.iter().flatten().map(Vec::as_slice).collect();
    let (found, covariance) = if flat.is_empty() { (vec![], vec![]) } else { least_squares(&flat, problem.y())? };
    let mut at = 0;
    let taken = chosen
        .iter()
        .map(|&(index, constant)| {
            let candidate = candidates[index].clone();
            let range = at..at + candidate.coefficients();
            at = range.end;
            Taken {
                constant,
                coefficients: found[range.clone()].to_vec(),
                sigmas: range.map(|i| covariance[i][i].sqrt()).collect(),
                constant_sigma: 0.0,
                improvement: 0.0,
                p_value: 0.0,
                rivals: Vec::new(),
                by_references: by_references(problem, &candidate, constant),
                candidate,
            }
        })
        .collect();
    Some((taken, covariance))
}

/// One effect beside all the others: an orthonormal basis of these, and what they leave.
pub fn beside(problem: &Problem, candidates: &[Candidate], chosen: &[Chosen], i: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
    let others: Vec<_> = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, each)| *each).collect();
    let basis = problem.basis(candidates, &others);
    let left = problem.left(&basis);
    (basis, left)
}

/// Sigma of a non-linear constant from the curvature of the sum of squares at it.
pub fn constant_sigma(problem: &Problem, candidates: &[Candidate], chosen: &[Chosen], i: usize) -> f64 {
    let (index, constant) = chosen[i];
    let candidate = &candidates[index];
    if candidate.grid.is_empty() {
        return 0.0;
    }
    let (basis, left) = beside(problem, candidates, chosen, i);
    let of = |constant: f64| improvement(&basis, &left, problem.projected(candidate, constant));
    let step = 0.02 * constant;
    let curvature = (2.0 * of(constant) - of(constant - step) - of(constant + step)) / (step * step);
    if curvature > 0.0 { (2.0 / curvature).sqrt() } else { constant }
}

/// The non-linear constant by golden section between its neighbours on the grid: constant and improvement.
pub fn refined(
    problem: &Problem,
    candidate: &Candidate,
    (basis, left): (&[Vec<f64>], &[f64]),
    about: f64,
) -> (f64, f64) {
    let of = |constant: f64| improvement(basis, left, problem.projected(candidate, constant));
    let mut sorted = candidate.grid.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    if sorted.is_empty() {
        return (about, of(about));
    }
    let below = sorted.iter().copied().rfind(|&each| each < about * (1.0 - 1e-9)).unwrap_or(about);
    let above = sorted.iter().copied().find(|&each| each > about * (1.0 + 1e-9)).unwrap_or(about);
    let (mut low, mut high) = (below.ln(), above.ln());
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut fa, mut fb) = (of(a.exp()), of(b.exp()));
    for _ in 0..12 {
        if fa > fb {
            (high, b, fb) = (b, a, fa);
            a = high - ratio * (high - low);
            fa = of(a.exp());
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + ratio * (high - low);
            fb = of(b.exp());
        }
    }
    let best = if fa > fb { (a.exp(), fa) } else { (b.exp(), fb) };
    let kept = of(about);
    if best.1 > kept { best } else { (about, kept) }
}

/// A merit with its constant refined.
pub fn refine(problem: &Problem, candidates: &[Candidate], beside: (&[Vec<f64>], &[f64]), merit: &Merit) -> Merit {
    let candidate = &candidates[merit.index];
    let (constant, improvement) = refined(problem, candidate, beside, merit.constant);
    Merit { index: merit.index, constant, improvement, score: score(candidate, improvement, problem.rows()) }
}

//! Non-linear constants: the best one between those of the grid, and its sigma.

use super::candidate::Candidate;
use super::estimate::beside;
use super::evidence::{improvement, score};
use super::learned::Scored;
use super::problem::{Chosen, Problem};

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

/// A scored with its constant refined.
pub fn refine(problem: &Problem, candidates: &[Candidate], beside: (&[Vec<f64>], &[f64]), scored: &Scored) -> Scored {
    let candidate = &candidates[scored.index];
    let (constant, improvement) = refined(problem, candidate, beside, scored.constant);
    Scored { index: scored.index, constant, improvement, score: score(candidate, improvement, problem.rows()) }
}

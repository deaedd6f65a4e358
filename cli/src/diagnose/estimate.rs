//! The chosen effects together: their coefficients and covariance, and one of them beside the others.

use super::candidate::{Candidate, Columns};
use super::learned::Taken;
use super::problem::{Chosen, Problem};
use super::statistics::least_squares;

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
                alternatives: Vec::new(),
                by_references: problem.by_references(&candidate, constant),
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

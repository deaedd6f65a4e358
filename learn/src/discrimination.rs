//! What runs tell of effects that may be the true one: how much of each no weights of another one imitate.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::Effect;

use super::functions::{Library, Values};
use super::problem::Problem;
use super::rows::Run;

/// Smallest share of a column that must be left beside the others of its effect: less is rounding.
const INDEPENDENT: f64 = 1e-9;

/// One effect by another.
#[derive(Clone, Debug)]
pub struct Imitated {
    /// Sum of squares of what is left of the effect, in noise variances: half of it are the log odds that the runs give on average, if it is the true one.
    pub left: f64,
    /// The other effect with the weights that imitate it best.
    pub by: Effect,
}

/// Every effect (by its weights) by every other one, in these runs beside their own unknowns and a process.
pub fn imitated(runs: &[Run], process: Option<&Process>, effects: &[Effect]) -> Vec<Vec<Imitated>> {
    let problem = Problem::new(runs, process);
    let library = Library::new(runs);
    let values: Vec<Values> = effects.iter().map(|effect| library.values(runs, effect)).collect();
    let all: Vec<&Vec<f64>> = values.iter().flatten().collect();
    let products = problem.columns(&all).squares();
    let first = |i: usize| values[..i].iter().map(Vec::len).sum::<usize>();
    let scaled = |i: usize| {
        let effect = &effects[i];
        DVector::from_iterator(
            effect.count(),
            effect.weights.iter().enumerate().map(|(k, weight)| f64::from(*weight) / effect.prior(k)),
        )
    };
    let block = |i: usize, j: usize| products.view((first(i), first(j)), (values[i].len(), values[j].len()));
    let by_other = |i: usize, j: usize| {
        let own = scaled(i);
        let whole = own.dot(&(block(i, i) * &own));
        let right = block(j, i) * &own;
        let (explained, weights) = explained(block(j, j).into_owned(), &right);
        let mut by = effects[j].clone();
        let priors: Vec<f64> = (0..by.count()).map(|k| by.prior(k)).collect();
        by.weights.iter_mut().zip(weights.iter().zip(priors)).for_each(|(to, (own, prior))| *to = (own * prior) as f32);
        Imitated { left: (whole - explained).max(0.0), by }
    };
    (0..effects.len()).map(|i| (0..effects.len()).map(|j| by_other(i, j)).collect()).collect()
}

/// What columns with these inner products explain of a column with these products with them, and their weights then.
fn explained(own: DMatrix<f64>, right: &DVector<f64>) -> (f64, DVector<f64>) {
    let eigen = own.symmetric_eigen();
    let least = INDEPENDENT * eigen.eigenvalues.max();
    let along = eigen.eigenvectors.tr_mul(right);
    let inverse = eigen.eigenvalues.map(|value| if value > least { 1.0 / value } else { 0.0 });
    let weights = &eigen.eigenvectors * along.component_mul(&inverse);
    (along.component_mul(&along).dot(&inverse), weights)
}

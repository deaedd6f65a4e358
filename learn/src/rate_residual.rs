//! What effects leave of the rates of a run.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::Effect;

use super::functions::Library;
use super::rows::{Run, UNKNOWNS};

/// Chi-square of a run's rates by degree of freedom, with the run's own azimuth, amplitude and bias estimated from them: 1 where effects leave
/// nothing but white noise. `None` for too few rows, or where these do not determine the unknowns.
pub fn chi_square_by_freedom(run: &Run, effects: &[Effect]) -> Option<f64> {
    let runs = std::slice::from_ref(run);
    let library = Library::new(runs);
    let mut residual = run.residual_deg_h();
    for effect in effects {
        for (number, (column, weight)) in library.values(runs, effect).iter().zip(&effect.weights).enumerate() {
            let by_unit = f64::from(*weight) / effect.prior(number);
            residual.iter_mut().zip(column).for_each(|(residual, value)| *residual -= by_unit * value);
        }
    }
    let inverse: Vec<f64> = run.variance.iter().map(|variance| 1.0 / variance.sqrt()).collect();
    let unknowns = run.unknowns();
    let design = DMatrix::from_fn(run.rows(), UNKNOWNS, |row, column| unknowns[column][row] * inverse[row]);
    let white = DVector::from_iterator(run.rows(), residual.iter().zip(&inverse).map(|(rate, inverse)| rate * inverse));
    let freedom = run.rows().checked_sub(UNKNOWNS).filter(|&freedom| freedom > 0)?;
    let shares = design.tr_mul(&design).cholesky()?.solve(&design.tr_mul(&white));
    Some((white - design * shares).norm_squared() / freedom as f64)
}

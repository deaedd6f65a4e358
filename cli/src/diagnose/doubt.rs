//! What is not certain of the learned effects, written into the model: the firmware's sigma holds it.

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use north_finder::effects::doubt::MAX_DIRECTIONS;
use north_finder::effects::{ErrorModel, TooMany};
use north_finder::units::{DEG_PER_RAD, wrap_180_deg};

use super::learned::Learned;
use crate::run_data::RunData;

/// Fewest dwells that give an azimuth.
const LEAST_DWELLS: f64 = 3.0;
/// One sigma of an angle of which nothing is known: that of an even distribution over the circle.
const UNKNOWN_DEG: f64 = 104.0;

/// The model of `learned` over `base`, with the uncertainty of what was learned: as directions of the terms' coefficients
/// where there is room for them, else by what it does to the azimuths of the runs in `fit`, root mean square.
///
/// Errors: more terms than a model can hold.
pub fn model(learned: &Learned, base: &ErrorModel, fit: &[&RunData]) -> Result<ErrorModel, TooMany> {
    let mut model = learned.model(base)?;
    let coefficients =
        |model: &ErrorModel| model.terms.iter().flat_map(|term| term.coefficients.clone()).collect::<Vec<f32>>();
    let nominal = coefficients(&model);
    for direction in &mut model.doubt.directions {
        direction.resize(nominal.len(), 0.0).map_err(|_| TooMany)?;
    }
    let mut directions = directions(learned)
        .into_iter()
        .map(|step| {
            let moved = learned.model_with(base, &step)?;
            Ok((mean_square_turn_deg2(fit, &model, &moved), moved))
        })
        .collect::<Result<Vec<_>, TooMany>>()?;
    directions.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left_deg2 = 0.0;
    for (turn_deg2, moved) in directions {
        let step: heapless::Vec<f32, _> = coefficients(&moved).iter().zip(&nominal).map(|(a, b)| a - b).collect();
        if model.doubt.directions.len() == MAX_DIRECTIONS || step.iter().all(|number| *number == 0.0) {
            left_deg2 += turn_deg2;
            continue;
        }
        // What is no coefficient of a term is left.
        let others = ErrorModel { terms: model.terms.clone(), doubt: model.doubt.clone(), ..moved };
        left_deg2 += mean_square_turn_deg2(fit, &model, &others);
        model.doubt.directions.push(step).map_err(|_| TooMany)?;
    }
    model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(left_deg2.sqrt());
    Ok(model)
}

/// Coefficients one sigma away along each principal direction of their covariance.
fn directions(learned: &Learned) -> Vec<Vec<f64>> {
    let nominal: Vec<f64> = learned.taken.iter().flat_map(|each| each.coefficients.clone()).collect();
    if nominal.is_empty() {
        return Vec::new();
    }
    let covariance = DMatrix::from_fn(nominal.len(), nominal.len(), |i, j| learned.covariance[i][j]);
    // Coefficients have units of their own: principal directions are those of their correlations.
    let scale: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.sqrt().max(f64::MIN_POSITIVE)).collect();
    let correlation = DMatrix::from_fn(nominal.len(), nominal.len(), |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let eigen = SymmetricEigen::new(correlation);
    eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
        .map(|(value, vector)| {
            let size = value.max(0.0).sqrt();
            nominal.iter().zip(vector.iter()).zip(&scale).map(|((c, part), scale)| c + size * part * scale).collect()
        })
        .collect()
}

/// Mean square of what another model makes of the azimuths, degrees².
fn mean_square_turn_deg2(fit: &[&RunData], model: &ErrorModel, other: &ErrorModel) -> f64 {
    if *model == (ErrorModel { doubt: model.doubt.clone(), ..other.clone() }) {
        return 0.0;
    }
    let turn =
        |run: &&RunData| Some(wrap_180_deg(run.solve(other)?.0.azimuth_deg - run.solve(model)?.0.azimuth_deg).powi(2));
    let turns: Vec<f64> = fit.par_iter().filter_map(turn).collect();
    turns.iter().sum::<f64>() / turns.len().max(1) as f64
}

/// The model, with a process of the runs' own that hides the Earth's rate in a run, which has an azimuth without it, turned into a sigma of every
/// azimuth: that of as few dwells as give one, each off by one sigma of the process.
pub fn shown(model: ErrorModel, runs: &[RunData]) -> ErrorModel {
    let Some(process) = model.doubt.process else { return model };
    let has_azimuth = |run: &RunData, model: &ErrorModel| run.replay(model, &mut |_| ()).is_ok();
    let mut without = model.clone();
    without.doubt.process = None;
    let hides = |run: &RunData| run.before.is_some() && !has_azimuth(run, &model) && has_azimuth(run, &without);
    if !runs.par_iter().any(hides) {
        return model;
    }
    let north_deg_h = runs.iter().map(|run| run.earth.north_deg_h).fold(f64::INFINITY, f64::min);
    let sigma_deg = DEG_PER_RAD * process.sigma_deg_h / north_deg_h * (2.0 / LEAST_DWELLS).sqrt();
    without.doubt.azimuth_sigma_deg = without.doubt.azimuth_sigma_deg.hypot(sigma_deg.min(UNKNOWN_DEG));
    without
}

//! A turn that all references share: the index zero stands elsewhere, or the references were turned.

use north_finder::effects::ErrorModel;
use north_finder::fix::DesignRow;
use north_finder::sensing::index::Direction;
use north_finder::units::{sin_cos_deg, wrap_180_deg};

use super::statistics::median;
use crate::campaign::Role;
use crate::run_data::RunData;

/// A turn that is taken out before smaller effects are looked for, degrees: the candidates' columns are those of small ones.
const LARGE_DEG: f64 = 3.0;
/// Share of it that the runs may differ by.
const APART: f64 = 0.2;
/// Fewest training runs with a reference that tell it.
const LEAST_RUNS: usize = 3;

/// By how much the azimuths of all training runs are off by the same angle, if that is too much for a small effect, degrees.
pub fn common_deg(runs: &[RunData]) -> Option<f64> {
    let fit = runs.iter().filter(|run| run.role == Role::Fit);
    let errors: Vec<f64> =
        fit.filter_map(|run| Some(wrap_180_deg(run.before?.azimuth_deg - run.reference_deg?))).collect();
    let first = *errors.first()?;
    let turn_deg = wrap_180_deg(first + median(errors.iter().map(|error| wrap_180_deg(error - first)).collect()));
    let apart_deg = median(errors.iter().map(|error| wrap_180_deg(error - turn_deg).abs()).collect());
    let found = errors.len() >= LEAST_RUNS && turn_deg.abs() > LARGE_DEG && apart_deg < APART * turn_deg.abs();
    found.then_some(turn_deg)
}

/// Takes an index that reads too large by `turn_deg` out of a run.
pub fn take_out(run: &mut RunData, turn_deg: f64, base: &ErrorModel) {
    let (s, c) = sin_cos_deg(turn_deg);
    for sample in &mut run.samples {
        (sample.cos, sample.sin) = (sample.cos * c + sample.sin * s, sample.sin * c - sample.cos * s);
        sample.design = DesignRow::new(Direction { cos: sample.cos, sin: sample.sin }, sample.level, &run.earth);
    }
    run.turned_deg = Some(turn_deg);
    run.before = run.solve(base).map(|(fix, _)| fix);
}

/// Puts it into a model.
pub fn put(model: &mut ErrorModel, turn_deg: f64) {
    model.index_error.get_or_insert_default().offset_deg += turn_deg;
}

//! A process of the runs' own that would take every azimuth away.

use north_finder::effects::ErrorModel;
use north_finder::units::DEG_PER_RAD;
use rayon::prelude::*;

use crate::run_data::RunData;

/// Fewest dwells that give an azimuth.
const LEAST_DWELLS: f64 = 3.0;
/// One sigma of an angle of which nothing is known: that of an even distribution over the circle.
pub const UNKNOWN_DEG: f64 = 104.0;

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

//! What a model leaves in doubt: azimuths that a process of the runs' own would take away, and what another model turns them by.

use north_finder::effects::ErrorModel;
use north_finder::units::{DEG_PER_RAD, wrap_180_deg};
use rayon::prelude::*;

use super::statistics::rms;
use crate::run_data::RunData;

/// Fewest dwells that give an azimuth.
const LEAST_DWELLS: f64 = 3.0;
/// One sigma of an angle of which nothing is known, and the error of a run without an azimuth, root mean square, degrees: 360°/√12, of an even distribution
/// over the circle.
pub const UNKNOWN_DEG: f64 = 103.923;

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

/// What the azimuths of runs differ by from one model to another, degrees, root mean square over the runs that have both.
pub fn turned_deg(runs: &[RunData], models: [&ErrorModel; 2]) -> f64 {
    let azimuth_deg = |run: &RunData, model: &ErrorModel| Some(run.replay(model, &mut |_| ()).ok()?.azimuth_deg);
    let [a, b] = models.map(|model| runs.par_iter().map(|run| azimuth_deg(run, model)).collect::<Vec<_>>());
    apart_deg(&a, &b)
}

fn apart_deg(a: &[Option<f64>], b: &[Option<f64>]) -> f64 {
    let apart = |(a, b): (&Option<f64>, &Option<f64>)| Some(wrap_180_deg((*a)? - (*b)?));
    rms(&a.iter().zip(b).filter_map(apart).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 359° and 2° lie 3° apart, 10° and 6° lie 4°: √((9 + 16)/2) = 3.5355°. A run without an azimuth by one of two says nothing.
    #[test]
    fn azimuths_apart_by_hand() {
        let apart = apart_deg(&[Some(359.0), Some(10.0), None], &[Some(2.0), Some(6.0), Some(1.0)]);
        assert!((apart - 12.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(apart_deg(&[None], &[None]), 0.0);
    }
}

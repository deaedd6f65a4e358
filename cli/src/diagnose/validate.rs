//! Whether what was found is used: by runs that took no part in learning, each judged by what the others taught.

use north_finder::effects::ErrorModel;
use north_finder::event::Fix;
use rayon::prelude::*;

use super::found::Found;
use super::stations::misses_deg;
use super::statistics::{rms, rms_with_interval};
use super::{LeaveOneOut, doubt, guard, names};
use crate::campaign::Role;
use crate::learn::Family;
use crate::run_data::RunData;

/// Folds of the validation, each of which learns again without its share of the runs.
const FOLDS: usize = 4;

/// What of all that was found is used.
pub struct Validated {
    pub model: ErrorModel,
    /// What was found is in the model.
    pub used: bool,
    /// Training runs by what was learned from others of them.
    pub left_out: Vec<Option<Fix>>,
    /// Names of what must not be used, and why.
    pub withdrawn: Option<(Vec<String>, String)>,
}

/// Judges what was found; `wrong`: files whose references are not believed.
pub fn validated(
    runs: &[RunData],
    found: Option<&Found>,
    base: &ErrorModel,
    family: &Family,
    wrong: &[String],
) -> Validated {
    let before = || runs.iter().map(|run| run.before).collect();
    let Some(found) = found.filter(|found| !found.is_nothing()) else {
        return Validated { model: base.clone(), used: false, left_out: before(), withdrawn: None };
    };
    let places: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect();
    let left_out = by_the_others(runs, &places, FOLDS, base, family, wrong);
    match guard::veto(runs, &found.model, &left_out, wrong) {
        None => Validated { model: found.model.clone(), used: true, left_out, withdrawn: None },
        Some(why) => {
            let mut names: Vec<String> = found.named().into_iter().map(names::full_name).collect();
            if names.is_empty() {
                names.push("base-motion".into());
            }
            let model = if found.named().is_empty() { base.clone() } else { found.without_effects(base) };
            Validated { model, used: false, left_out: before(), withdrawn: Some((names, why)) }
        }
    }
}

/// These runs, each by what was learned from the others of them, in so many parts at most: azimuth and sigma by the firmware's replay, in the order
/// of all runs; `None` where there is no azimuth. Where the others teach nothing, the runs are as they were. A reference that is not believed teaches
/// nothing: `wrong` are the files of such runs.
fn by_the_others(
    runs: &[RunData],
    places: &[usize],
    folds: usize,
    base: &ErrorModel,
    family: &Family,
    wrong: &[String],
) -> Vec<Option<Fix>> {
    let without_reference = |run: &RunData| {
        let mut run = wrong.contains(&run.file).then(|| run.clone())?;
        run.reference_deg = None;
        Some(run)
    };
    let unbelieved: Vec<Option<RunData>> = runs.iter().map(without_reference).collect();
    let folds = folds.min(places.len());
    let mut fixes = vec![None; runs.len()];
    for fold in 0..folds {
        let inside = |place: usize| place % folds == fold;
        let training: Vec<&RunData> = places
            .iter()
            .enumerate()
            .filter(|(place, _)| !inside(*place))
            .map(|(_, &i)| unbelieved[i].as_ref().unwrap_or(&runs[i]))
            .collect();
        let model = Found::learn(&training, base, family).map_or_else(|| base.clone(), |found| found.model);
        let model = doubt::shown(model, runs);
        for (_, &i) in places.iter().enumerate().filter(|(place, _)| inside(*place)) {
            fixes[i] = runs[i].replay(&model, &mut |_| ()).ok();
        }
    }
    fixes
}

/// All runs with a reference or at a station, whatever their role, each by what was learned from all others. Nothing of it enters the model.
pub fn leave_one_out(runs: &[RunData], base: &ErrorModel, family: &Family, wrong: &[String]) -> Option<LeaveOneOut> {
    let places: Vec<usize> = (0..runs.len()).collect();
    let fixes = by_the_others(runs, &places, runs.len(), base, family, wrong);
    let errors = |fixes: &[Option<Fix>]| -> Vec<Option<f64>> {
        let azimuths: Vec<Option<f64>> = fixes.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect();
        let misses = misses_deg(runs, &azimuths).into_iter().zip(runs);
        misses.map(|(miss, run)| miss.filter(|_| !wrong.contains(&run.file))).collect()
    };
    let as_read: Vec<Option<Fix>> = runs.par_iter().map(|run| run.before).collect();
    let before: Vec<f64> = errors(&as_read).into_iter().flatten().collect();
    let errors_deg = errors(&fixes);
    let in_sigmas = errors_deg.iter().zip(runs.iter().zip(&fixes)).filter_map(|(error, (run, fix))| {
        Some(error.as_ref()? / fix.as_ref()?.sigma_deg.hypot(run.reference_sigma_deg))
    });
    let errors: Vec<f64> = errors_deg.iter().flatten().copied().collect();
    let (azimuth_rms_deg, azimuth_rms_interval_deg) = rms_with_interval(&errors)?;
    Some(LeaveOneOut {
        runs: errors.len(),
        azimuth_rms_before_deg: rms_with_interval(&before).map(|each| each.0),
        azimuth_rms_deg,
        azimuth_rms_interval_deg,
        errors_over_sigma_rms: rms(&in_sigmas.collect::<Vec<f64>>()),
        errors_deg,
    })
}

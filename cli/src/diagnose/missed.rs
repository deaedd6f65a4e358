//! References that the runs contradict.

use north_finder::units::wrap_180_deg;

use super::Warning;
use super::found::WrongReference;
use super::result::{MissedReference, RunDiagnosis};
use crate::run_data::RunData;

/// A reference that is missed by more than this, in degrees and in sigmas, is named.
const MISS_DEG: f64 = 1.0;
const MISS_SIGMAS: f64 = 5.0;

/// Warns of seconds that are no seconds of the gyro.
pub fn warn_of_outliers(runs: &[RunData], warnings: &mut Vec<Warning>) {
    for (run, &line) in runs.iter().flat_map(|run| run.outliers.iter().map(move |line| (run, line))) {
        let message = "the rate jumps for this second: it is left out as an outlier";
        warnings.push(Warning::of_run(&run.file, message).at_line(line));
    }
}

/// References that are wrong by what the runs say of each other, and runs whose azimuth is far from the reference, whatever was found: something is
/// wrong with one of the two. It is warned of each.
pub fn missed(records: &[RunDiagnosis], wrong: &[WrongReference], warnings: &mut Vec<Warning>) -> Vec<MissedReference> {
    let mut missed = Vec::new();
    for run in records {
        let found = WrongReference::of(wrong, &run.file);
        let azimuth = run.azimuth_after_deg.zip(run.sigma_after_deg);
        let (Some((azimuth_deg, sigma_deg)), Some(reference_deg)) = (azimuth, run.reference_azimuth_deg) else {
            warnings.extend(found.map(|found| Warning::of_run(&run.file, found.in_words())));
            continue;
        };
        let misses_by_deg = wrap_180_deg(azimuth_deg - reference_deg);
        let sigmas = misses_by_deg.abs() / sigma_deg;
        let far = misses_by_deg.abs() > MISS_DEG.max(MISS_SIGMAS * sigma_deg);
        if found.is_none() && !far {
            continue;
        }
        let exchanged_with = found.and_then(|each| each.exchanged_with.clone());
        let message = match (&exchanged_with, found) {
            (Some(other), _) => format!("its reference seems to be that of {other}, and the other way round"),
            (None, Some(_)) => format!(
                "its reference does not fit the other runs' by {:+.2} deg: it is not used; survey it again",
                -misses_by_deg
            ),
            (None, None) => format!(
                "the azimuth misses the reference by {misses_by_deg:+.2} deg ({sigmas:.0} sigma): the reference, or the run, is wrong"
            ),
        };
        warnings.push(Warning::of_run(&run.file, message));
        missed.push(MissedReference { file: run.file.clone(), misses_by_deg, sigmas, exchanged_with });
    }
    missed
}

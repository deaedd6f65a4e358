//! The outcome in words.

use north_finder::units::wrap_180_deg;

use super::statistics::rms;
use super::{Diagnosis, Effect, RunDiagnosis};
use crate::campaign::Role;
use crate::count::counted;

/// Runs that miss their references by more than three sigmas of both, but for those that are named as wrong anyway.
fn missing(diagnosis: &Diagnosis) -> usize {
    let misses = |run: &&RunDiagnosis| {
        let apart = wrap_180_deg(run.azimuth_after_deg? - run.reference_azimuth_deg?).abs();
        Some(apart > 3.0 * run.sigma_after_deg?.hypot(run.reference_sigma_deg))
    };
    let named = |run: &&RunDiagnosis| diagnosis.missed_references.iter().any(|each| each.file == run.file);
    diagnosis.runs.iter().filter(|run| misses(run) == Some(true) && !named(run)).count()
}

/// How far apart the azimuths of the stations are, where no heading is surveyed; of still recordings the rate; where there is neither, by how much the
/// azimuths change, or that nothing judges them.
fn of_stations(diagnosis: &Diagnosis) -> String {
    if let (Some(before), Some(after)) = (diagnosis.rate_rms_before_deg_h, diagnosis.rate_rms_after_deg_h) {
        return format!(
            ": rate of a second {before:.4} deg/h rms before, {after:.4} after, where nothing was learned from"
        );
    }
    match (diagnosis.station_spread_before_deg, diagnosis.station_spread_after_deg) {
        (Some(before), Some(after)) => {
            format!(": azimuths of one station lie {before:.3} deg apart before, {after:.3} deg after (rms)")
        }
        _ if !diagnosis.effects.is_empty() => {
            let changes: Vec<f64> = diagnosis.runs.iter().filter_map(change_deg).collect();
            format!(": no reference and no station confirms the azimuths, which change by {:.3} deg rms", rms(&changes))
        }
        _ if has_unjudged_azimuths(diagnosis) => {
            "; without a reference or a station an effect that changes azimuths and leaves no residual is not seen"
                .into()
        }
        _ => String::new(),
    }
}

/// Whether there are azimuths, and no run has a reference: one whose reference is not believed has it all the same.
fn has_unjudged_azimuths(diagnosis: &Diagnosis) -> bool {
    let is_surveyed = |run: &RunDiagnosis| run.reference_azimuth_deg.is_some();
    diagnosis.runs.iter().any(|run| run.azimuth_after_deg.is_some()) && !diagnosis.runs.iter().any(is_surveyed)
}

/// By how much the azimuth of a run changes, degrees.
fn change_deg(run: &RunDiagnosis) -> Option<f64> {
    Some(wrap_180_deg(run.azimuth_after_deg? - run.azimuth_before_deg?))
}

/// The tests that what is left fails.
fn failed_tests(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.noise.after.iter().filter(|test| test.failed()).map(|test| test.name.as_str()).collect()
}

/// What was found, or that nothing was.
fn of_effects(diagnosis: &Diagnosis, names: &[String], failed: &[&str]) -> String {
    match names {
        [] if diagnosis.unexplained => {
            let what = if failed.is_empty() {
                "The rates are noise by every test, but not what azimuths miss their references by"
            } else {
                "The residual is not noise"
            };
            let why =
                if diagnosis.withdrawn.is_some() { "no effect is taken out of it" } else { "no candidate explains it" };
            format!("{what}, and {why}")
        }
        [] if diagnosis.runs.iter().all(|run| run.role != Role::Fit) => {
            "Nothing may be learned from these runs".to_owned()
        }
        [] if missing(diagnosis) > 0 => {
            format!(
                "Nothing was found, but {} of the runs miss their references by more than 3 sigma",
                missing(diagnosis)
            )
        }
        [] if failed.is_empty() && diagnosis.missed_references.is_empty() => {
            "Nothing was found: the residual is consistent with noise by every test".to_owned()
        }
        [] if failed.is_empty() => "Nothing was found in the rates, which are noise by every test".to_owned(),
        [] => format!("Nothing was found, but the residual is not noise by {}", failed.join(" and ")),
        names => format!("The model lacked {}", names.join(" and ")),
    }
}

/// How the azimuth errors change.
fn of_azimuths(diagnosis: &Diagnosis) -> String {
    match (diagnosis.azimuth_rms_before_deg, diagnosis.azimuth_rms_after_deg) {
        (Some(before), Some(after)) if !diagnosis.effects.is_empty() => {
            let (had, have) = (diagnosis.judged_before(), diagnosis.judged_runs);
            let some = match had < have {
                true => format!(" (only {had} of {} had an azimuth)", counted(have, "run")),
                false => String::new(),
            };
            let on_board = match diagnosis.azimuth_rms_board_deg {
                Some(board) if !diagnosis.board_lacks.is_empty() => format!(", {board:.3} deg on a board"),
                _ => String::new(),
            };
            match [before, after].map(|error| format!("{error:.3}")) {
                [before, after] if before == after => {
                    format!(": it shows in the rate; the azimuth error stays {after} deg rms{some}{on_board}")
                }
                [before, after] => {
                    format!(": azimuth error {before} deg rms before{some}, {after} deg after{on_board}")
                }
            }
        }
        (before, Some(after)) => {
            let after = format!("{after:.3}");
            match before.map(|before| format!("{before:.3}")) {
                Some(before) if before != after => {
                    format!(": azimuth error {before} deg rms before, {after} deg after")
                }
                _ => format!(": azimuth error {after} deg rms"),
            }
        }
        _ => of_stations(diagnosis),
    }
}

/// The outcome in a sentence or two.
pub fn sentence(diagnosis: &Diagnosis) -> String {
    let names: Vec<String> = diagnosis.effects.iter().map(Effect::full_name).collect();
    let failed = failed_tests(diagnosis);
    let found = of_effects(diagnosis, &names, &failed);
    let change = of_azimuths(diagnosis);
    let rest = if names.is_empty() {
        String::new()
    } else if diagnosis.unexplained {
        "; structure remains that nothing explains".into()
    } else if failed.is_empty() {
        String::new()
    } else {
        format!("; the residual is still not noise by {}", failed.join(" and "))
    };
    let ambiguous = if diagnosis.effects.iter().any(|effect| !effect.ambiguous_with.is_empty()) {
        "; this campaign cannot tell every cause from others"
    } else {
        ""
    };
    let withdrawn = diagnosis.withdrawn.as_ref().map_or(String::new(), |why| format!("; {why}"));
    let missed = match diagnosis.missed_references.as_slice() {
        [] => String::new(),
        [one] => format!("; {} misses its reference by {:+.2} deg", one.file, one.misses_by_deg),
        [first, others @ ..] => format!("; {} and {} more miss their references", first.file, others.len()),
    };
    format!("{found}{change}{withdrawn}{rest}{ambiguous}{missed}.")
}

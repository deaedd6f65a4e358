//! What is checked of a recording that has been read, whatever is made of it: whether the sensor vouches for it, and whether its samples
//! came as the mapping says.

use std::path::Path;

use super::sample::Sampler;
use super::{Format, Map, Summary};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};

/// Samples come at the declared rate within this share: 0.5 %. A gyro of one family was seen at 962 Hz instead of 1000
/// with every status bit good, a scale error of 4 %.
const RATE_TOLERANCE: f64 = 0.005;
/// Samples are missing in a step that is longer than this many mean ones.
const LONG_STEP: f64 = 2.5;

/// Errors: a recording of which the sensor vouches for no sample.
pub fn refuse_dead(sampler: &Sampler, file: &Path) -> Result<(), FileError> {
    let (due, invalid) = (sampler.due(), sampler.losses().invalid_samples);
    if invalid == 0 || invalid < due {
        return Ok(());
    }
    let problem = format!("each of its {invalid} samples is marked as not valid by the sensor itself");
    Err(FileError::whole(file, Problem::Syntax(problem)))
}

/// Holds the samples' number against a clock that is not the gyro's: the recording's duration, or its time stamps;
/// and these against each other. The rates and what is doubtful about them go into the summary.
///
/// Errors: time stamps of arrival where samples are to be counted by them; clocks that differ.
pub fn check_rate(
    map: &Map,
    format: Format,
    summary: &mut Summary,
    sampler: &Sampler,
    file: &Path,
) -> Result<(), Failure> {
    refuse_arrivals(sampler, file)?;
    let time = &map.time;
    let stamped_s = (!time.columns.is_empty()).then(|| sampler.end_s());
    if let (Some(stamped_s), Some(duration_s)) = (stamped_s, time.duration_s)
        && differ(stamped_s, duration_s)
    {
        return Err(Failure::Refused(format!(
            "{}: the time stamps span {stamped_s:.3} s, duration_s says {duration_s} s; allowed is a difference of {} %",
            file.display(),
            100.0 * RATE_TOLERANCE
        )));
    }
    summary.declared_rate_hz = time.interval_s.map(f64::recip);
    let elapsed_s = time.duration_s.or(stamped_s);
    match (summary.declared_rate_hz, elapsed_s) {
        (Some(declared_hz), Some(elapsed_s)) => {
            summary.measured_rate_hz = Some(sampler.due() as f64 / elapsed_s);
            return refuse_rate(declared_hz, elapsed_s, sampler, file);
        }
        (Some(_), None) if format == Format::Kvh => summary.doubts.push(
            "the gyro's own clock is the only one: with duration_s in [time], the recording's length by another clock, \
             its rate is checked"
                .into(),
        ),
        (Some(_), None) => {}
        (None, _) => summary.doubts.extend(doubt_of_gap(sampler, file)),
    }
    Ok(())
}

fn differ(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() > RATE_TOLERANCE
}

/// A late time stamp makes a step that is too long, which counts as lost samples, and steps after it that are too short, each of which
/// still counts as a sample.
///
/// Errors: there is such a short step for every second lost sample, or for more of them.
fn refuse_arrivals(sampler: &Sampler, file: &Path) -> Result<(), Failure> {
    let (short, lost) = (sampler.short_steps(), sampler.lost_by_stamps());
    if lost == 0 || 2 * short < lost {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "{}: {short} time stamps lie closer than half a sample to the one before, and {lost} samples seem lost by longer \
         steps: these are times of arrival; leave out `column` and give rate_hz with duration_s, or leave out rate_hz",
        file.display()
    )))
}

/// Errors: the samples did not come at the declared rate.
fn refuse_rate(declared_hz: f64, elapsed_s: f64, sampler: &Sampler, file: &Path) -> Result<(), Failure> {
    let due = sampler.due();
    let measured_hz = due as f64 / elapsed_s;
    if !differ(measured_hz, declared_hz) {
        return Ok(());
    }
    let (short, lost) = (sampler.short_steps(), sampler.lost_by_stamps());
    let remedy = if short > 0 && lost > 0 {
        format!(
            "{short} time stamps lie closer than half a sample to the one before, so that some may be times of arrival: \
             leave out `column` and give rate_hz with duration_s, or leave out rate_hz"
        )
    } else {
        "Gyros with a clock of their own do this with every status bit good: declare the rate that was measured, or \
         correct the duration"
            .into()
    };
    Err(Failure::Refused(format!(
        "{}: samples came at {measured_hz:.3} Hz ({due} in {elapsed_s:.3} s), declared are {declared_hz:.3} Hz; allowed \
         is a difference of {} %. {remedy}",
        file.display(),
        100.0 * RATE_TOLERANCE
    )))
}

/// The longest gap of a recording whose time stamps alone say when samples came: without a declared interval nothing counts what is
/// missing.
fn doubt_of_gap(sampler: &Sampler, file: &Path) -> Option<String> {
    let (longest_s, place) = sampler.longest_step()?;
    let mean_s = sampler.end_s() / sampler.due() as f64;
    if *longest_s <= LONG_STEP * mean_s {
        return None;
    }
    let decimals: usize = if mean_s < 0.01 { 6 } else { 3 };
    let file = file.display();
    Some(format!(
        "{file}{place}: {longest_s:.decimals$} s without a sample, where a step is {mean_s:.decimals$} s in the mean; with \
         rate_hz in [time] what is missing is counted"
    ))
}

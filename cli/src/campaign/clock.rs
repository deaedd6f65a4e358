//! Whether times can be seconds: a recorder that counts milliseconds makes every rate a thousandth of what it was.

use crate::file_error::Problem;

/// Rows lie no further apart, seconds: a quarter of an hour is longer than any dwell, and seconds counted in milliseconds lie 1000 apart.
const LONGEST_STEP_S: f64 = 900.0;
/// Rows further apart than this, seconds, for longer than `LONG_S` are doubted: 400 Hz counted in milliseconds are rows every 2.5 s, and five minutes
/// of them are three and a half days.
const SLOW_S: f64 = 1.5;
const LONG_S: f64 = 2.0 * 86_400.0;
/// No recording pauses for longer, seconds: what is longer is a clock that was set.
const LONGEST_GAP_S: f64 = 86_400.0;

/// Errors: no rows of a recording lie so far apart as these usually do.
pub fn check_step(step_s: f64) -> Result<(), Problem> {
    match step_s > LONGEST_STEP_S {
        false => Ok(()),
        true => Err(Problem::not_allowed(
            format!("rows {step_s} s apart"),
            format!("at most {LONGEST_STEP_S} s: times are in seconds, and these may be milliseconds"),
        )),
    }
}

/// Errors: no gap within a run is so long.
pub fn check_gap(step_s: f64) -> Result<(), Problem> {
    match step_s > LONGEST_GAP_S {
        false => Ok(()),
        true => Err(Problem::not_allowed(
            format!("a gap of {step_s} s"),
            format!(
                "at most {LONGEST_GAP_S} s within a run: times are in seconds, of a clock that is not set meanwhile"
            ),
        )),
    }
}

/// What is doubtful about a recording of this length whose rows usually lie so far apart, both in seconds.
pub fn doubt(step_s: f64, seconds: f64) -> Option<String> {
    (step_s > SLOW_S && seconds > LONG_S).then(|| {
        format!(
            "its rows lie {step_s} s apart for {:.1} days: if the recorder counts milliseconds, every rate is a thousandth of what it was",
            seconds / 86_400.0
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_was_set_is_refused_and_a_night_without_rows_is_not() {
        assert!(check_gap(3.2e7).unwrap_err().to_string().contains("\"a gap of 32000000 s\""));
        assert!(check_gap(43_200.0).is_ok());
    }

    #[test]
    fn milliseconds_are_refused_or_doubted() {
        assert!(check_step(1000.0).unwrap_err().to_string().contains("may be milliseconds"));
        assert!(check_step(900.0).is_ok());
        // A fix of 300 s at 400 Hz in milliseconds; an hour of seconds; a log of a week in rows of a second.
        assert!(doubt(2.5, 300_000.0).unwrap().contains("2.5 s apart for 3.5 days"));
        assert_eq!((doubt(10.0, 3600.0), doubt(1.0, 604_800.0)), (None, None));
    }
}

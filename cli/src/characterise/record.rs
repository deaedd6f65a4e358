//! A still recording: angle against time at an even interval.

use std::path::Path;

use north_finder::units::wrap_180_deg;

use crate::campaign::RunReader;
use crate::file_error::{FileError, Place, Problem};

/// The index may show this much of the encoder's noise, degrees.
const REST_DEG: f64 = 0.5;
/// Rows may differ from the usual interval by this share of it: time stamps are rounded.
const UNEVEN: f64 = 0.25;
/// Fewer one-second rates say nothing of a gyro.
const LEAST_SECONDS: f64 = 60.0;
/// Increments are counts if each is a multiple of the smallest step within this share of the step.
const MULTIPLE: f64 = 1e-3;
/// With fewer increments on each count, a common divisor may be chance.
const LEAST_PER_COUNT: usize = 3;

/// Angle at even steps, from 0 at the start: one more than there are rows.
#[derive(Clone, Debug)]
pub struct Record {
    pub interval_s: f64,
    pub angle_arcsec: Vec<f64>,
}

/// Reads a run whose index never moves.
///
/// Errors: as [`RunReader`]; the index moves; a gap or uneven rows; less than a minute.
pub fn read(path: &Path) -> Result<Record, FileError> {
    let mut angle_arcsec = vec![0.0];
    let (mut first, mut end_s, mut start_s, mut angle) = (None, 0.0, 0.0, 0.0);
    for (line, row) in (2..).zip(RunReader::open(path)?) {
        let row = row?;
        let &mut (interval_s, index_deg) = first.get_or_insert_with(|| {
            start_s = row.t_s - row.interval_s;
            (row.interval_s, row.index_deg)
        });
        let refuse = |value: String, allowed: &str| {
            Err(FileError::new(path, Place::Line(line), Problem::not_allowed(value, allowed)))
        };
        let moved_deg = wrap_180_deg(row.index_deg - index_deg);
        if moved_deg.abs() > REST_DEG {
            return refuse(format!("index_deg = {}", row.index_deg), "a recording in which the index never moves");
        }
        if (row.interval_s - interval_s).abs() > UNEVEN * interval_s {
            let value = format!("an interval of {} s", row.interval_s);
            return refuse(value, &format!("rows without a gap, every {interval_s} s as the first"));
        }
        angle += row.fog_arcsec;
        angle_arcsec.push(angle);
        end_s = row.t_s;
    }
    let interval_s = (end_s - start_s) / (angle_arcsec.len() - 1) as f64;
    if end_s - start_s < LEAST_SECONDS {
        let value = format!("a recording of {} s", end_s - start_s);
        return Err(FileError::whole(path, Problem::not_allowed(value, format!("{LEAST_SECONDS} s and longer"))));
    }
    Ok(Record { interval_s, angle_arcsec })
}

impl Record {
    pub fn seconds(&self) -> f64 {
        (self.angle_arcsec.len() - 1) as f64 * self.interval_s
    }

    /// Mean rates over one second (over a row, where rows are longer), °/h.
    pub fn one_second_rates_deg_h(&self) -> Vec<f64> {
        let rows = ((1.0 / self.interval_s).round() as usize).max(1);
        let ends: Vec<f64> = self.angle_arcsec.iter().step_by(rows).copied().collect();
        ends.windows(2).map(|pair| (pair[1] - pair[0]) / (rows as f64 * self.interval_s)).collect()
    }

    /// Smallest step between two increments, if all are multiples of it.
    pub fn quantum_arcsec(&self) -> Option<f64> {
        let mut increments: Vec<f64> = self.angle_arcsec.windows(2).map(|pair| pair[1] - pair[0]).collect();
        increments.sort_unstable_by(f64::total_cmp);
        let span = increments.last()? - increments.first()?;
        // Below this, two increments differ by the rounding of their sum.
        let rounding = 1e-9 * span.max(increments.last()?.abs());
        let steps = || increments.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > rounding);
        let quantum = steps().fold(f64::INFINITY, f64::min);
        let counts = steps().count() + 1;
        let multiples =
            steps().all(|step| (step / quantum - (step / quantum).round()).abs() < MULTIPLE * step / quantum);
        (quantum.is_finite() && multiples && increments.len() >= LEAST_PER_COUNT * counts).then_some(quantum)
    }
}

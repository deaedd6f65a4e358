//! A gyro triad in known positions: from recordings to the twelve parameters.

use std::path::{Path, PathBuf};

use calibration::six_position::dwell::Dwell;
use calibration::six_position::published::{self, Published};
use calibration::six_position::{self, Calibration, Position, Refusal};
use serde::Serialize;

use super::columns::{Column, Table};
use super::manifest::Manifest;
use crate::file_error::FileError;

/// Length of the intervals whose mean rates are judged and averaged, s, if the rows are shorter.
const MEAN_S: f64 = 1.0;
/// A recording has at least this many of them, even if they must be shorter.
const LEAST_MEANS: f64 = 60.0;
/// Part of an interval that rows must fill.
const LEAST_FILLED: f64 = 0.9;
/// A change of temperature between positions that biases may follow, K.
const NOTED_K: f64 = 1.0;

/// A solved set, or the reason why there is no solution.
#[derive(Debug)]
pub struct Outcome {
    pub latitude_deg: f64,
    pub visits: Vec<Visit>,
    pub calibration: Calibration,
    /// By the published difference formulas, where the set has the six positions.
    pub published: Option<Published>,
}

/// A position and what its recording says.
#[derive(Debug)]
pub struct Visit {
    pub name: String,
    pub position: Position,
    /// Length of the intervals that the dwell's rows count, s.
    pub mean_s: f64,
    /// Mean temperature, °C, if the file has it.
    pub temp_c: Option<f64>,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum SixPositionError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: {reason}")]
    Dwell { file: String, reason: String },
    #[error("{file}: {reason}")]
    Refused { file: String, reason: String },
}

/// The machine-readable result; field names are stable.
#[derive(Debug, Serialize)]
pub struct Record {
    pub bias_deg_h: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    pub sigma_bias_deg_h: [f64; 3],
    pub sigma_matrix: [[f64; 3]; 3],
    /// Absent numbers where the set is not that of the formulas.
    pub published_bias_deg_h: Option<[f64; 3]>,
    pub published_matrix: Option<[[f64; 3]; 3]>,
    pub closure_rms_deg_h: Option<f64>,
    pub closure_p_value: Option<f64>,
}

/// The files of a folder (or manifest) that [`calibrate`] reads: the manifest and the recordings in it.
///
/// Errors: those of the manifest.
pub fn files(path: &Path) -> Result<Vec<PathBuf>, FileError> {
    let Manifest { path, positions, .. } = Manifest::read(path)?;
    Ok(std::iter::once(path).chain(positions.into_iter().map(|listed| listed.path)).collect())
}

/// Reads the folder (or manifest) and solves it.
pub fn calibrate(path: &Path) -> Result<Outcome, SixPositionError> {
    let manifest = Manifest::read(path)?;
    let mut visits = Vec::with_capacity(manifest.positions.len());
    for listed in manifest.positions {
        let recording = Recording::read(&listed.path)?;
        let mut scratch = vec![0.0; recording.rates_deg_h.len()];
        let dwell = Dwell::of(&recording.rates_deg_h, recording.mean_s, &mut scratch).map_err(|error| {
            SixPositionError::Dwell { file: listed.path.display().to_string(), reason: error.to_string() }
        })?;
        let position = Position { axes: listed.axes, dwell };
        visits.push(Visit { name: listed.name, position, mean_s: recording.mean_s, temp_c: recording.temp_c });
    }
    let positions: Vec<_> = visits.iter().map(|visit| visit.position).collect();
    let latitude_deg = manifest.knowledge.latitude_deg;
    let calibration = six_position::solve(&positions, &manifest.knowledge).map_err(|refusal| {
        SixPositionError::Refused { file: manifest.path.display().to_string(), reason: explain(&refusal, &visits) }
    })?;
    Ok(Outcome { latitude_deg, published: by_formulas(&positions, latitude_deg), visits, calibration })
}

/// Lowest and highest temperature of the positions, °C, if they differ so much that biases may follow.
pub fn noted_temperatures(visits: &[Visit]) -> Option<[f64; 2]> {
    let temperatures = visits.iter().filter_map(|visit| visit.temp_c);
    let low = temperatures.clone().fold(f64::INFINITY, f64::min);
    let high = temperatures.fold(f64::NEG_INFINITY, f64::max);
    (high - low > NOTED_K).then_some([low, high])
}

impl Outcome {
    /// The machine-readable result.
    pub fn record(&self) -> Record {
        let Calibration { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix, closure } = self.calibration;
        Record {
            bias_deg_h,
            matrix,
            sigma_bias_deg_h,
            sigma_matrix,
            published_bias_deg_h: self.published.map(|published| published.bias_deg_h),
            published_matrix: self.published.map(|published| published.matrix),
            closure_rms_deg_h: closure.rms_deg_h,
            closure_p_value: closure.p_value,
        }
    }
}

/// The published formulas, if each of their positions is there; the first of each.
pub fn by_formulas(positions: &[Position], latitude_deg: f64) -> Option<Published> {
    let rates = published::axes()
        .ok()?
        .map(|axes| positions.iter().find(|position| position.axes == axes).map(|position| position.dwell.rate_deg_h));
    let [one, two, three, four, five, six] = rates;
    published::differences(&[one?, two?, three?, four?, five?, six?], latitude_deg).ok()
}

/// The refusal, with the names of the files where it counts positions, and what may have made a closure large.
fn explain(refusal: &Refusal, visits: &[Visit]) -> String {
    let files = |wanted: &dyn Fn(usize) -> bool| {
        let wanted = visits.iter().enumerate().filter(|(number, _)| wanted(*number));
        let listed: Vec<_> = wanted.map(|(number, visit)| format!("{} = {}", number + 1, visit.name)).collect();
        if listed.is_empty() { String::new() } else { format!(" ({})", listed.join(", ")) }
    };
    match refusal {
        Refusal::Closure { suspects, exchanged, .. } => {
            let is_exchanged = |number: usize| exchanged.is_some_and(|(one, other)| number == one || number == other);
            let suspects = files(&|number| is_exchanged(number) || number < 64 && suspects >> number & 1 == 1);
            let warmth = noted_temperatures(visits).map_or(String::new(), |[low, high]| {
                format!("; the temperature differs from {low:.1} to {high:.1} C between the positions")
            });
            format!("{refusal}{suspects}{warmth}")
        }
        Refusal::NoScatter { position } => format!("{refusal}{}", files(&|number| number == *position)),
        _ => refusal.to_string(),
    }
}

/// A recording as mean rates over intervals of equal length.
struct Recording {
    rates_deg_h: Vec<[f64; 3]>,
    mean_s: f64,
    temp_c: Option<f64>,
}

impl Recording {
    /// Columns `t_s, gx_arcsec, gy_arcsec, gz_arcsec` and perhaps `temp_c`. `t_s` is the end of the interval of the
    /// increments, which begins at the row before; the first row's at 0, or, if it stands at 0, a median step earlier.
    fn read(path: &Path) -> Result<Self, FileError> {
        let columns = ["t_s", "gx_arcsec", "gy_arcsec", "gz_arcsec", "temp_c"].map(Column::Named);
        let table = Table::read(path, columns, 1)?;
        table.check_increasing(0)?;
        table.check_gapless(0)?;
        let rows = with_intervals(&table.rows);
        let (from_s, to_s) = match (table.rows.first(), table.rows.last()) {
            (Some([first_s, ..]), Some([last_s, ..])) => (first_s - rows.first().map_or(0.0, |row| row.0), *last_s),
            _ => (0.0, 0.0),
        };
        let step_s = median(rows.iter().map(|row| row.0).collect());
        let mean_s = MEAN_S.min((to_s - from_s) / LEAST_MEANS).max(step_s);
        let count = table.rows.len() as f64;
        let temp_c = table.has(4).then(|| table.rows.iter().map(|row| row[4]).sum::<f64>() / count);
        Ok(Self { rates_deg_h: means(&table.rows, &rows, from_s, mean_s), mean_s, temp_c })
    }
}

/// Length of each row's interval, s, and its middle.
fn with_intervals(rows: &[[f64; 5]]) -> Vec<(f64, f64)> {
    let steps: Vec<_> = rows.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let first_s = match rows.first() {
        Some([t_s, ..]) if *t_s > 0.0 && steps.is_empty() => *t_s,
        Some([t_s, ..]) => {
            let median_s = median(steps.clone());
            // A recording may begin anywhere: a first interval much longer than the others is not one.
            if *t_s > 0.0 && *t_s < 1.5 * median_s { *t_s } else { median_s }
        }
        None => 0.0,
    };
    let lengths = std::iter::once(first_s).chain(steps);
    lengths.zip(rows).map(|(length_s, row)| (length_s, row[0] - 0.5 * length_s)).collect()
}

/// Mean rates over intervals of `mean_s`; those that the rows do not fill are left out.
fn means(rows: &[[f64; 5]], intervals: &[(f64, f64)], from_s: f64, mean_s: f64) -> Vec<[f64; 3]> {
    let mut means = Vec::new();
    let (mut number, mut filled_s, mut arcsec) = (0_u64, 0.0, [0.0; 3]);
    let mut end = |filled_s: f64, arcsec: [f64; 3]| {
        if filled_s >= LEAST_FILLED * mean_s {
            means.push(arcsec.map(|sum| sum / filled_s));
        }
    };
    for (&[_, x, y, z, _], &(length_s, middle_s)) in rows.iter().zip(intervals) {
        let of_row = ((middle_s - from_s) / mean_s).floor() as u64;
        if of_row != number {
            end(filled_s, arcsec);
            (number, filled_s, arcsec) = (of_row, 0.0, [0.0; 3]);
        }
        filled_s += length_s;
        for (sum, part) in arcsec.iter_mut().zip([x, y, z]) {
            *sum += part;
        }
    }
    end(filled_s, arcsec);
    means
}

fn median(mut values: Vec<f64>) -> f64 {
    quantities::median::median(&mut values).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn increments_become_rates() {
        // 0.1 arcsec in 10 ms are 10 °/h; y turns the other way; 150 rows are one and a half seconds.
        let rows: Vec<_> = (1..=150).map(|i| [f64::from(i) * 0.01, 0.1, -0.1, 0.0, 0.0]).collect();
        let intervals = with_intervals(&rows);
        let means = means(&rows, &intervals, 0.0, 1.0);
        assert_eq!(means.len(), 1);
        assert!((means[0][0] - 10.0).abs() < 1e-9 && (means[0][1] + 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_recording_may_begin_anywhere() {
        let rows: Vec<_> = (0..10).map(|i| [1000.0 + f64::from(i), 5.0, 0.0, 0.0, 0.0]).collect();
        assert_eq!(with_intervals(&rows)[0], (1.0, 999.5));
        let from_zero: Vec<_> = (0..10).map(|i| [f64::from(i) * 2.0, 5.0, 0.0, 0.0, 0.0]).collect();
        assert_eq!(with_intervals(&from_zero)[0], (2.0, -1.0));
    }
}

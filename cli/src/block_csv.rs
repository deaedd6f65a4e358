//! Recordings of a three-axis block: `t_s, gx_arcsec, gy_arcsec, gz_arcsec, ax_m_s2, ay_m_s2, az_m_s2`.

use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Trim};
use north_finder::attitude::Increment;
use north_finder::units::ARCSEC_PER_RAD;

use crate::file_error::{FileError, Place, Problem};

/// The columns, in the order of their axes: x forward, y left, z up.
pub const COLUMNS: [&str; 7] = ["t_s", "gx_arcsec", "gy_arcsec", "gz_arcsec", "ax_m_s2", "ay_m_s2", "az_m_s2"];
/// Of a heading to compare with, degrees; optional.
const REFERENCE: &str = "reference_heading_deg";

/// One row: what the block felt in the interval that ends at `t_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockRow {
    pub t_s: f64,
    /// Time since the row before; the first row: since 0, or the median step if it stands at 0.
    pub interval_s: f64,
    pub increment: Increment,
    pub reference_heading_deg: Option<f64>,
}

/// A recording and the usual time between its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockRecording {
    pub rows: Vec<BlockRow>,
    pub step_s: f64,
}

/// Reads a recording. Errors: no such file, a column missing, a field that is no number, time that does not increase, no rows.
pub fn read(path: &Path) -> Result<BlockRecording, FileError> {
    let whole = |error: csv::Error| FileError::whole(path, std::io::Error::from(error));
    let mut csv = ReaderBuilder::new().flexible(true).trim(Trim::All).from_path(path).map_err(whole)?;
    let header: Vec<String> = csv.headers().map_err(whole)?.iter().map(str::to_owned).collect();
    if header.iter().all(String::is_empty) {
        return Err(FileError::whole(path, Problem::Empty));
    }
    let find = |name: &str| header.iter().position(|column| column == name);
    let mut places = [0; COLUMNS.len()];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = find(name).ok_or_else(|| {
            FileError::new(path, Place::Line(1), Problem::MissingColumn { name, found: header.join(", ") })
        })?;
    }
    let reference = find(REFERENCE);
    let mut times: Vec<([f64; COLUMNS.len()], Option<f64>)> = Vec::new();
    let mut record = ByteRecord::new();
    while csv.read_byte_record(&mut record).map_err(whole)? {
        let line = record.position().map_or(0, |position| position.line());
        if record.len() != header.len() {
            let problem = Problem::Ragged { found: record.len(), expected: header.len() };
            return Err(FileError::new(path, Place::Line(line), problem));
        }
        let field = |column: usize, problem: Problem| {
            let name = header.get(column).cloned().unwrap_or_default();
            FileError::new(path, Place::Field { line, column: column + 1, name }, problem)
        };
        let number = |column: usize| {
            let text = String::from_utf8_lossy(record.get(column).unwrap_or_default());
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(field(column, Problem::not_allowed(text, "a finite number"))),
            }
        };
        let mut row = [0.0; COLUMNS.len()];
        for (value, column) in row.iter_mut().zip(places) {
            *value = number(column)?;
        }
        if let Some((previous, _)) = times.last()
            && row[0] <= previous[0]
        {
            let problem = Problem::TimeNotIncreasing { t_s: row[0], previous_s: previous[0] };
            return Err(field(places[0], problem));
        }
        times.push((row, reference.map(number).transpose()?));
    }
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1].0[0] - pair[0].0[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let step_s = *steps.get(steps.len() / 2).ok_or_else(|| FileError::whole(path, Problem::NoRows))?;
    let mut previous_s = if times[0].0[0] > 0.0 { 0.0 } else { times[0].0[0] - step_s };
    let rows = times
        .into_iter()
        .map(|([t_s, gx, gy, gz, ax, ay, az], reference_heading_deg)| {
            let interval_s = t_s - std::mem::replace(&mut previous_s, t_s);
            let angle = [gx, gy, gz].map(|arcsec| arcsec / ARCSEC_PER_RAD);
            let velocity = [ax, ay, az].map(|m_s2| m_s2 * interval_s);
            let increment = Increment { angle_rad: angle.into(), velocity_m_s: velocity.into() };
            BlockRow { t_s, interval_s, increment, reference_heading_deg }
        })
        .collect();
    Ok(BlockRecording { rows, step_s })
}

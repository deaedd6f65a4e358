//! A gate for every row of a recording of a three-axis block: no single row may turn a heading or move a place.
//!
//! A reading is an outlier where it is outside of what its neighbours span, without the `SPARED` of them at either end, by more than
//! `SIGMAS` of the scatter of readings about the medians of theirs (Hampel, The influence curve and its role in robust estimation,
//! 1974). What begins and goes on is a motion, and is left. So is a shock, which gyros and accelerometers measure together: a block that is
//! turned by 0.1° within 10 ms is accelerated by 2 m/s² at 5 cm from its axis. An outlier is replaced by the median of its neighbours: what
//! is then wrong of it is a reading's noise. In a still window an outlier of δ just within the gate turns the heading by 1.5 δ/T at the most; white
//! noise of the readings with the step τ has a sigma of δ/15 √(T/τ)/T. That is less than one sigma from 500 rows on.

use std::fmt;
use std::path::Path;

use north_finder::units::{ARCSEC_PER_RAD, DEG_PER_RAD};
use schemars::JsonSchema;
use serde::Serialize;

use crate::block_csv::{BlockRecording, BlockRow, COLUMNS};
use crate::failure::Failure;

/// Of the scatter around a reading. Of 121,600 rows of a triad in a vehicle that rocks the most is below it.
const SIGMAS: f64 = 15.0;
/// Neighbours on either side that a reading is compared with.
const NEIGHBOURS: usize = 5;
/// So many of them may be outliers of the same sign themselves.
const SPARED: usize = 2;
/// Rows whose scatter is taken together; the loudest of a row's own and the two beside it counts, as a motion begins somewhere.
const TOGETHER: usize = 50;
/// Standard deviation of normal noise over the median of its sizes.
const NORMAL: f64 = 1.4826;
/// Fewest readings that differ from their neighbours and tell how finely an axis is rounded.
const ROUNDED: usize = 3;
/// Readings that differ by less than this share of themselves are the same: counts that were scaled differ in their last digits, by
/// 6e-8 where that was done in single precision.
const SAME: f64 = 1e-7;
/// Rows at the most between what gyros and what accelerometers measure of the same shock.
const SHOCK_ROWS: usize = 2;
/// What no gyro, °/s, and no accelerometer, m/s² (1000 g), of a navigation block measures.
pub const MOST_DEG_S: f64 = 10_000.0;
const MOST_M_S2: f64 = 9806.65;

/// A row that was taken out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Outlier {
    pub t_s: f64,
    pub column: &'static str,
    /// In the column's unit.
    pub value: f64,
}

/// What the gate has done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Gated {
    /// Rows with an outlier.
    pub rows: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<Outlier>,
}

impl fmt::Display for Gated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(Outlier { t_s, column, value }) = self.first else { return write!(f, "no outliers") };
        let rows = if self.rows == 1 { "1 row has an outlier" } else { &format!("{} rows have outliers", self.rows) };
        write!(f, "{rows}, replaced by the median of the rows around; the first at t_s = {t_s}: {column} = {value:e}")
    }
}

/// Replaces outliers in place.
///
/// Errors: readings that no block measures and that are no outliers, as there are too many of them.
pub fn gate(recording: &mut BlockRecording, file: &Path) -> Result<Gated, Failure> {
    let most = |axis: usize| if axis < 3 { MOST_DEG_S / DEG_PER_RAD * recording.step_s } else { MOST_M_S2 };
    let unit = |axis: usize| if axis < 3 { ARCSEC_PER_RAD } else { 1.0 };
    let found: [Vec<(usize, f64)>; 6] = std::array::from_fn(|axis| {
        let readings: Vec<f64> = recording.rows.iter().map(|row| reading(row, axis)).collect();
        outliers(&readings)
    });
    let possible = |axis: usize, row: usize| reading(&recording.rows[row], axis).abs() <= most(axis);
    let shocked = |mut axes: std::ops::Range<usize>, row: usize| {
        axes.any(|axis| {
            found[axis].iter().any(|(other, _)| other.abs_diff(row) <= SHOCK_ROWS && possible(axis, *other))
        })
    };
    let mut replaced: Vec<(usize, usize, f64)> = Vec::new();
    for (axis, outliers) in found.iter().enumerate() {
        let others = if axis < 3 { 3..6 } else { 0..3 };
        let alone = outliers.iter().filter(|(row, _)| !(possible(axis, *row) && shocked(others.clone(), *row)));
        replaced.extend(alone.map(|(row, median)| (*row, axis, *median)));
    }
    replaced.sort_unstable_by_key(|(row, axis, _)| (*row, *axis));
    let first = replaced.first().map(|(row, axis, _)| {
        let row = &recording.rows[*row];
        Outlier { t_s: row.t_s, column: COLUMNS[axis + 1], value: reading(row, *axis) * unit(*axis) }
    });
    for (row, axis, median) in &replaced {
        set(&mut recording.rows[*row], *axis, *median);
    }
    for axis in 0..6 {
        if let Some(row) = recording.rows.iter().find(|row| reading(row, axis).abs() > most(axis)) {
            return Err(Failure::Refused(format!(
                "{}: t_s = {}: {} is {:e}, beyond what any {} measures, and so are rows beside it",
                file.display(),
                row.t_s,
                COLUMNS[axis + 1],
                reading(row, axis) * unit(axis),
                if axis < 3 { "gyro" } else { "accelerometer" },
            )));
        }
    }
    replaced.dedup_by_key(|(row, ..)| *row);
    Ok(Gated { rows: replaced.len(), first })
}

/// Increment of angle, rad, or specific force, m/s².
fn reading(row: &BlockRow, axis: usize) -> f64 {
    match axis.checked_sub(3) {
        None => row.increment.angle_rad[axis],
        Some(axis) => row.increment.velocity_m_s[axis] / row.interval_s,
    }
}

fn set(row: &mut BlockRow, axis: usize, value: f64) {
    match axis.checked_sub(3) {
        None => row.increment.angle_rad[axis] = value,
        Some(axis) => row.increment.velocity_m_s[axis] = value * row.interval_s,
    }
}

/// Outliers of a sequence of readings: their places, and what they are replaced by.
pub fn outliers(readings: &[f64]) -> Vec<(usize, f64)> {
    let around: Vec<Around> = (0..readings.len()).map(|row| Around::new(readings, row)).collect();
    let off: Vec<f64> = readings.iter().zip(&around).map(|(reading, around)| around.off(*reading)).collect();
    let mut differing: Vec<f64> = off.iter().copied().filter(|off| *off > 0.0).collect();
    differing.sort_unstable_by(f64::total_cmp);
    let step = if differing.len() < ROUNDED { 0.0 } else { differing[0] };
    let scatter: Vec<f64> = off.chunks(TOGETHER).map(|chunk| NORMAL * median(&mut chunk.to_vec())).collect();
    let allowed = |row: usize| {
        let chunk = row / TOGETHER;
        let beside = &scatter[chunk.saturating_sub(1)..scatter.len().min(chunk + 2)];
        SIGMAS * beside.iter().copied().fold(step, f64::max)
    };
    let rows = readings.iter().zip(&around).enumerate();
    let beyond = rows.filter(|(row, (reading, around))| around.beyond(**reading) > allowed(*row));
    beyond.map(|(row, (_, around))| (row, around.median)).collect()
}

/// The neighbours of a reading; at the recording's ends as many, on the one side.
struct Around {
    least: f64,
    median: f64,
    most: f64,
}

impl Around {
    fn new(readings: &[f64], row: usize) -> Self {
        let from = row.saturating_sub(NEIGHBOURS).min(readings.len().saturating_sub(2 * NEIGHBOURS + 1));
        let to = readings.len().min(from + 2 * NEIGHBOURS + 1);
        let mut around: Vec<f64> = (from..to).filter(|other| *other != row).map(|other| readings[other]).collect();
        let median = median(&mut around);
        around.sort_unstable_by(f64::total_cmp);
        let inner = around.get(SPARED..around.len().saturating_sub(SPARED)).unwrap_or_default();
        Self { least: inner.first().copied().unwrap_or(median), median, most: inner.last().copied().unwrap_or(median) }
    }

    /// From the median.
    fn off(&self, reading: f64) -> f64 {
        let off = (reading - self.median).abs();
        if off > SAME * reading.abs().max(self.median.abs()) { off } else { 0.0 }
    }

    fn beyond(&self, reading: f64) -> f64 {
        (reading - self.most).max(self.least - reading)
    }
}

/// The lower one of two; 0 of none.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len().saturating_sub(1) / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of one unit, uniform, from the golden ratio.
    fn noise(rows: usize) -> Vec<f64> {
        (1..=rows).map(|row| (row as f64 * 0.618_033_988_75).fract() - 0.5).collect()
    }

    #[test]
    fn one_absurd_reading_is_found_wherever_it_is_and_nothing_else() {
        for place in [0, 1, 7, 100, 498, 499] {
            for value in [30.0, -1e3, 1e6, -1e20, 1e300] {
                let mut readings = noise(500);
                readings[place] = value;
                let found = outliers(&readings);
                let [(row, median)] = found[..] else { panic!("{place} {value}: {found:?}") };
                assert!(row == place && median.abs() <= 0.5, "{place} {value}: {found:?}");
            }
        }
    }

    #[test]
    fn noise_counts_and_motions_are_no_outliers() {
        assert!(outliers(&noise(500)).is_empty());
        // A reading of one count in twenty rows, none in the others.
        let counts: Vec<f64> = (0..500).map(|row| f64::from(u8::from(row % 20 == 7))).collect();
        assert!(outliers(&counts).is_empty());
        // The same counts, scaled: their last digits differ, which is not how finely they are rounded. Every fifth is two.
        let scaled = |row: usize, count: f64| count * 0.1225 * (1.0 + 2e-16 * (row % 3) as f64);
        let scaled: Vec<f64> = (0..500).map(|row| scaled(row, if row % 5 == 2 { 2.0 } else { 1.0 })).collect();
        assert!(outliers(&scaled).is_empty(), "{:?}", outliers(&scaled));
        // It is turned: from rest to a hundred units within six rows, and back.
        let turned = |row: usize| f64::from((row as i32 - 200).clamp(0, 6) - (row as i32 - 300).clamp(0, 6)) * 16.0;
        let motion: Vec<f64> = noise(500).iter().enumerate().map(|(row, noise)| noise + turned(row)).collect();
        assert!(outliers(&motion).is_empty(), "{:?}", outliers(&motion));
    }
}

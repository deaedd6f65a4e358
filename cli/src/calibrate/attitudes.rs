//! Readings of an accelerometer triad at rest, attitude after attitude, from a file.

use std::path::Path;

use calibration::ellipsoid::attitude::{Attitude, OUTLIER_SIGMAS};
use calibration::statistics::SIGMA_PER_MEDIAN_DEVIATION;
use quantities::median::median;
use serde::Serialize;

use super::columns::{self, Column, Table};
use super::motion::{self, Restless};
use crate::failure::Failure;
use crate::file_error::FileError;

/// The readings at one attitude.
#[derive(Clone, Copy, Debug)]
pub struct Dwell {
    /// Number of the attitude in the recording, from 1; or its number in the file.
    pub number: f64,
    /// First and last moment, s, of a continuous recording.
    pub t_s: Option<[f64; 2]>,
    pub attitude: Attitude,
}

/// Something that did not enter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rejected {
    /// Number of the attitude in the recording, from 1; or its number in the file.
    pub attitude: f64,
    /// Its time, s, in a continuous recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_s: Option<[f64; 2]>,
    /// How many readings (of a continuous recording: quarter seconds) were left out.
    pub readings: u16,
    pub why: &'static str,
}

/// Why a file gives no readings at rest.
#[derive(Debug, thiserror::Error)]
pub enum AttitudesError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: {reason}")]
    Restless { file: String, reason: Restless },
}

impl From<AttitudesError> for Failure {
    fn from(error: AttitudesError) -> Self {
        match error {
            AttitudesError::File(error) => error.into(),
            restless @ AttitudesError::Restless { .. } => Self::Refused(restless.to_string()),
        }
    }
}

/// Reads a file: columns `attitude, ax, ay, az`, or `t_s, ax, ay, az`, whose still intervals are found.
pub fn read(path: &Path, rejected: &mut Vec<Rejected>) -> Result<Vec<Dwell>, AttitudesError> {
    let numbered = columns::header(path)?.iter().any(|name| name == "attitude");
    Ok(boil_down(if numbered { by_number(path)? } else { by_rest(path)? }, rejected))
}

/// The readings of one attitude before they are boiled down.
struct Group {
    number: f64,
    t_s: Option<[f64; 2]>,
    readings: Vec<[f64; 3]>,
    /// Readings left out already.
    shocks: u16,
}

/// Columns `attitude, ax, ay, az`: readings that belong together have the same number.
fn by_number(path: &Path) -> Result<Vec<Group>, FileError> {
    let columns = [Column::Named("attitude"), Column::WithUnit("ax"), Column::WithUnit("ay"), Column::WithUnit("az")];
    let table = Table::read(path, columns, 0)?;
    let mut groups: Vec<Group> = Vec::new();
    for &[number, x, y, z] in &table.rows {
        match groups.iter_mut().rev().find(|group| group.number == number) {
            Some(group) => group.readings.push([x, y, z]),
            None => groups.push(Group { number, t_s: None, readings: vec![[x, y, z]], shocks: 0 }),
        }
    }
    Ok(groups)
}

/// Columns `t_s, ax, ay, az`: the still intervals.
fn by_rest(path: &Path) -> Result<Vec<Group>, AttitudesError> {
    let columns = [Column::Named("t_s"), Column::WithUnit("ax"), Column::WithUnit("ay"), Column::WithUnit("az")];
    let table = Table::read(path, columns, 0)?;
    table.check_increasing(0)?;
    let rests = motion::rests(&table.rows, resolution(table.rows.iter().map(|[_, x, y, z]| [*x, *y, *z])))
        .map_err(|reason| AttitudesError::Restless { file: path.display().to_string(), reason })?;
    let group = |(i, rest): (usize, motion::Rested)| Group {
        number: i as f64 + 1.0,
        t_s: Some(rest.t_s),
        readings: rest.blocks,
        shocks: rest.shocks,
    };
    Ok(rests.into_iter().enumerate().map(group).collect())
}

/// Smallest step between successive readings of an axis; tiny for readings that are not counts.
fn resolution(readings: impl Iterator<Item = [f64; 3]>) -> f64 {
    let mut least = f64::INFINITY;
    let mut last: Option<[f64; 3]> = None;
    for reading in readings {
        if let Some(last) = last {
            for (now, before) in reading.into_iter().zip(last) {
                let step: f64 = now - before;
                least = if step == 0.0 { least } else { least.min(step.abs()) };
            }
        }
        last = Some(reading);
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Standard deviation that a reading is granted whatever the scatter of its own attitude: the middle of the robust scatters of
/// all attitudes and axes, or the smallest step. Ten readings alone may happen to lie close together.
pub fn granted_noise<'a>(attitudes: impl Iterator<Item = &'a [[f64; 3]]> + Clone) -> f64 {
    let deviation = |readings: &[[f64; 3]], axis: usize| {
        let mut values: Vec<_> = readings.iter().map(|reading| reading[axis]).collect();
        let middle = median(&mut values)?;
        values.iter_mut().for_each(|value| *value = (*value - middle).abs());
        median(&mut values)
    };
    let deviations = attitudes.clone().flat_map(|readings| (0..3).filter_map(move |axis| deviation(readings, axis)));
    let scatter = SIGMA_PER_MEDIAN_DEVIATION * median(&mut deviations.collect::<Vec<_>>()).unwrap_or(0.0);
    scatter.max(resolution(attitudes.flatten().copied()))
}

/// Means of the attitudes; outliers dropped.
fn boil_down(groups: Vec<Group>, rejected: &mut Vec<Rejected>) -> Vec<Dwell> {
    const OUTLIERS: &str = "readings beyond six robust standard deviations of their attitude";
    const _: () = assert!(OUTLIER_SIGMAS == 6.0);
    let granted = granted_noise(groups.iter().map(|group| group.readings.as_slice()));
    let mut dwells = Vec::with_capacity(groups.len());
    for Group { number, t_s, readings, shocks } in groups {
        if shocks > 0 {
            let why = "a shock moved the triad while at rest";
            rejected.push(Rejected { attitude: number, t_s, readings: shocks, why });
        }
        let mut scratch = vec![0.0; readings.len()];
        let count = u16::try_from(readings.len()).unwrap_or(u16::MAX);
        match Attitude::of(&readings, granted, &mut scratch) {
            Some(attitude) => {
                if attitude.dropped > 0 {
                    rejected.push(Rejected { attitude: number, t_s, readings: attitude.dropped, why: OUTLIERS });
                }
                dwells.push(Dwell { number, t_s, attitude });
            }
            None => {
                let why = "fewer than three readings that agree";
                rejected.push(Rejected { attitude: number, t_s, readings: count, why });
            }
        }
    }
    dwells
}

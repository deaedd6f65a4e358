//! An accelerometer triad in many attitudes: from a recording to its calibration.

use std::path::Path;

use north_finder::calibration::ellipsoid::attitude::{Attitude, OUTLIER_SIGMAS};
use north_finder::calibration::ellipsoid::{self, Calibration, Correction, Entry, Refusal, Role, nominal, norm_rms};
use north_finder::calibration::statistics::{SIGMA_PER_MEDIAN_DEVIATION, median};
use serde::Serialize;

use super::columns::{self, Column, Table};
use super::motion::{self, Restless};
use crate::file_error::FileError;

/// A solved recording.
#[derive(Debug)]
pub struct Outcome {
    pub stays: Vec<Stay>,
    pub calibration: Calibration,
    /// What readings were taken for before.
    pub nominal: Correction,
    /// Root mean square of |f| − G by `nominal`, over all attitudes that are valid.
    pub norm_rms_before: f64,
    pub rejected: Vec<Rejected>,
}

/// The readings at one attitude.
#[derive(Clone, Copy, Debug)]
pub struct Stay {
    /// First and last moment, s, of a continuous recording.
    pub t_s: Option<[f64; 2]>,
    pub entry: Entry,
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

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum EllipsoidError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: {reason}")]
    Restless { file: String, reason: Restless },
    #[error("{file}: {reason}")]
    Refused { file: String, reason: Refusal },
}

/// The machine-readable result; field names are stable.
#[derive(Debug, Serialize)]
pub struct Record {
    pub bias: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    pub sigma_bias: [f64; 3],
    /// Attitudes that entered: learned from or judged.
    pub attitudes: usize,
    pub coverage: f64,
    pub norm_rms_before: f64,
    pub norm_rms_after: f64,
    pub check_norm_rms_after: Option<f64>,
    pub rejected: Vec<Rejected>,
}

/// The readings of one attitude before they are boiled down.
struct Group {
    number: f64,
    t_s: Option<[f64; 2]>,
    readings: Vec<[f64; 3]>,
    /// Readings left out already.
    knocked: u16,
}

/// Reads and solves a recording; `gravity` is the norm of specific force at rest, in the unit that is wanted.
pub fn calibrate(path: &Path, gravity: f64) -> Result<Outcome, EllipsoidError> {
    let groups =
        if columns::header(path)?.iter().any(|name| name == "attitude") { by_number(path)? } else { by_rest(path)? };
    let mut rejected = Vec::new();
    let mut stays = boil_down(groups, &mut rejected);
    let mut entries: Vec<_> = stays.iter().map(|stay| stay.1.entry).collect();
    ellipsoid::split(&mut entries, gravity);
    let calibration = fit(&mut entries, gravity)
        .map_err(|reason| EllipsoidError::Refused { file: path.display().to_string(), reason })?;
    for ((number, stay), entry) in stays.iter_mut().zip(entries) {
        stay.entry = entry;
        if entry.role == Role::Invalid {
            let why = "its norm contradicts that of the others";
            rejected.push(Rejected { attitude: *number, t_s: stay.t_s, readings: entry.attitude.readings, why });
        }
    }
    let stays: Vec<_> = stays.into_iter().map(|(_, stay)| stay).collect();
    let valid = stays.iter().filter(|stay| stay.entry.role != Role::Invalid).map(|stay| stay.entry.attitude.mean);
    let nominal = nominal(valid.clone(), gravity);
    let norm_rms_before = norm_rms(valid, &nominal, gravity).unwrap_or_default();
    Ok(Outcome { stays, calibration, nominal, norm_rms_before, rejected })
}

/// Fits; as long as the attitudes to learn from do not cover the sphere, one less is only judged.
fn fit(entries: &mut Vec<Entry>, gravity: f64) -> Result<Calibration, Refusal> {
    loop {
        let mut fitted = entries.clone();
        let result = ellipsoid::fit(&mut fitted, gravity);
        let spared = entries.iter_mut().rev().find(|entry| entry.role == Role::Check);
        match (&result, spared) {
            (Err(Refusal::Coverage { .. }), Some(spared)) => spared.role = Role::Fit,
            _ => {
                *entries = fitted;
                return result;
            }
        }
    }
}

impl Outcome {
    /// The machine-readable result.
    pub fn record(&self) -> Record {
        Record {
            bias: self.calibration.correction.bias,
            matrix: self.calibration.correction.matrix,
            sigma_bias: self.calibration.sigma_bias,
            attitudes: self.count(Role::Fit) + self.count(Role::Check),
            coverage: self.calibration.coverage,
            norm_rms_before: self.norm_rms_before,
            norm_rms_after: self.calibration.norm_rms,
            check_norm_rms_after: self.calibration.check_norm_rms,
            rejected: self.rejected.clone(),
        }
    }

    /// Attitudes with a role.
    pub fn count(&self, role: Role) -> usize {
        self.means(role).count()
    }

    /// Mean readings of the attitudes with a role.
    pub fn means(&self, role: Role) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.stays.iter().filter(move |stay| stay.entry.role == role).map(|stay| stay.entry.attitude.mean)
    }
}

/// Columns `attitude, ax, ay, az`: readings that belong together have the same number.
fn by_number(path: &Path) -> Result<Vec<Group>, FileError> {
    let columns = [Column::Named("attitude"), Column::WithUnit("ax"), Column::WithUnit("ay"), Column::WithUnit("az")];
    let table = Table::read(path, columns, 0)?;
    let mut groups: Vec<Group> = Vec::new();
    for &[number, x, y, z] in &table.rows {
        match groups.iter_mut().rev().find(|group| group.number == number) {
            Some(group) => group.readings.push([x, y, z]),
            None => groups.push(Group { number, t_s: None, readings: vec![[x, y, z]], knocked: 0 }),
        }
    }
    Ok(groups)
}

/// Columns `t_s, ax, ay, az`: the still intervals.
fn by_rest(path: &Path) -> Result<Vec<Group>, EllipsoidError> {
    let columns = [Column::Named("t_s"), Column::WithUnit("ax"), Column::WithUnit("ay"), Column::WithUnit("az")];
    let table = Table::read(path, columns, 0)?;
    table.check_increasing(0)?;
    let rests = motion::rests(&table.rows, resolution(table.rows.iter().map(|[_, x, y, z]| [*x, *y, *z])))
        .map_err(|reason| EllipsoidError::Restless { file: path.display().to_string(), reason })?;
    let group = |(i, rest): (usize, motion::Rested)| Group {
        number: i as f64 + 1.0,
        t_s: Some(rest.t_s),
        readings: rest.blocks,
        knocked: rest.knocked,
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

/// Means of the attitudes, with their numbers; outliers dropped.
fn boil_down(groups: Vec<Group>, rejected: &mut Vec<Rejected>) -> Vec<(f64, Stay)> {
    const OUTLIERS: &str = "readings beyond six robust standard deviations of their attitude";
    const _: () = assert!(OUTLIER_SIGMAS == 6.0);
    let granted = granted_noise(groups.iter().map(|group| group.readings.as_slice()));
    let mut stays = Vec::with_capacity(groups.len());
    for Group { number, t_s, readings, knocked } in groups {
        if knocked > 0 {
            let why = "the triad was knocked while at rest";
            rejected.push(Rejected { attitude: number, t_s, readings: knocked, why });
        }
        let mut scratch = vec![0.0; readings.len()];
        let count = u16::try_from(readings.len()).unwrap_or(u16::MAX);
        match Attitude::of(&readings, granted, &mut scratch) {
            Some(attitude) => {
                if attitude.dropped > 0 {
                    rejected.push(Rejected { attitude: number, t_s, readings: attitude.dropped, why: OUTLIERS });
                }
                stays.push((number, Stay { t_s, entry: Entry { attitude, role: Role::Fit } }));
            }
            None => {
                let why = "fewer than three readings that agree";
                rejected.push(Rejected { attitude: number, t_s, readings: count, why });
            }
        }
    }
    stays
}

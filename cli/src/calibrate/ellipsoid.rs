//! An accelerometer triad in many attitudes: from a recording to its calibration.

use std::path::Path;

use calibration::ellipsoid::{self, Calibration, Correction, Entry, Misalignments, Refusal, Role, nominal, norm_rms};
use serde::Serialize;

use super::attitudes::{self, AttitudesError, Dwell, Rejected};

/// A solved recording.
#[derive(Debug)]
pub struct Outcome {
    pub dwells: Vec<Dwell>,
    /// What each of them was used for.
    pub roles: Vec<Role>,
    pub calibration: Calibration,
    /// What readings were taken for before.
    pub nominal: Correction,
    /// Root mean square of |f| − G by `nominal`, over all attitudes that are valid.
    pub norm_rms_before: f64,
    pub rejected: Vec<Rejected>,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum EllipsoidError {
    #[error(transparent)]
    Recording(#[from] AttitudesError),
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
    /// Norm of specific force at rest, in the unit of the corrected readings.
    pub gravity: f64,
    pub norm_rms_before: f64,
    pub norm_rms_after: f64,
    pub check_norm_rms_after: Option<f64>,
    pub rejected: Vec<Rejected>,
}

/// Reads and solves a recording; `gravity` is the norm of specific force at rest, in the unit that is wanted; `prior` are
/// misalignments known from an earlier calibration.
pub fn calibrate(path: &Path, gravity: f64, prior: Option<&Misalignments>) -> Result<Outcome, EllipsoidError> {
    let mut rejected = Vec::new();
    let dwells = attitudes::read(path, &mut rejected)?;
    let mut entries: Vec<_> = dwells.iter().map(|dwell| Entry { attitude: dwell.attitude, role: Role::Fit }).collect();
    ellipsoid::split(&mut entries, gravity);
    let calibration = fit(&mut entries, gravity, prior)
        .map_err(|reason| EllipsoidError::Refused { file: path.display().to_string(), reason })?;
    let roles: Vec<_> = entries.iter().map(|entry| entry.role).collect();
    for (dwell, _) in dwells.iter().zip(&roles).filter(|(_, role)| **role == Role::Invalid) {
        let why = "its norm contradicts that of the others";
        rejected.push(Rejected { attitude: dwell.number, t_s: dwell.t_s, readings: dwell.attitude.readings, why });
    }
    let valid = entries.iter().filter(|entry| entry.role != Role::Invalid).map(|entry| entry.attitude.mean);
    let nominal = nominal(valid.clone(), gravity);
    let norm_rms_before = norm_rms(valid, &nominal, gravity).unwrap_or_default();
    Ok(Outcome { dwells, roles, calibration, nominal, norm_rms_before, rejected })
}

/// Fits; as long as the attitudes to learn from do not cover the sphere, one less is only judged.
fn fit(entries: &mut Vec<Entry>, gravity: f64, prior: Option<&Misalignments>) -> Result<Calibration, Refusal> {
    loop {
        let mut fitted = entries.clone();
        let result = ellipsoid::fit_with(&mut fitted, gravity, prior);
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
    pub fn record(&self, gravity: f64) -> Record {
        Record {
            bias: self.calibration.correction.bias,
            matrix: self.calibration.correction.matrix,
            sigma_bias: self.calibration.sigma_bias,
            attitudes: self.count(Role::Fit) + self.count(Role::Check),
            coverage: self.calibration.coverage,
            gravity,
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
        let dwells = self.dwells.iter().zip(&self.roles);
        dwells.filter(move |(_, of)| **of == role).map(|(dwell, _)| dwell.attitude.mean)
    }
}

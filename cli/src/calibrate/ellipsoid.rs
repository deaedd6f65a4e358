//! An accelerometer triad in many attitudes: from a recording to its calibration.

use std::path::Path;

use calibration::ellipsoid::{
    self, Calibration, Correction, Entry, Misalignments, Refusal, Role, Weights, nominal, norm_rms,
};
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
    pub sigma_matrix: [[f64; 3]; 3],
    /// Readings per unit of specific force.
    pub scale: [f64; 3],
    /// Between the axes x and y, x and z, y and z.
    pub angles_deg: [f64; 3],
    /// Of the ellipsoid, readings, from the greatest to the least.
    pub half_axes: [f64; 3],
    /// Attitudes that entered: learned from or judged.
    pub attitudes: usize,
    pub learned_from: usize,
    pub judged: usize,
    pub coverage: f64,
    /// Norm of specific force at rest, in the unit of the corrected readings.
    pub gravity: f64,
    pub norm_rms_before: f64,
    pub norm_rms_after: f64,
    pub check_norm_rms_after: Option<f64>,
    /// Of the norm, beyond the noise of the readings; `None` where that explains what is left.
    pub excess_rms: Option<f64>,
    /// Where another calibration was to be judged.
    pub compared: Option<Compared>,
    pub rejected: Vec<Rejected>,
}

/// Root mean square of |f| − G by another calibration, in the unit of G; `None` without attitudes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Compared {
    /// Over the attitudes that this calibration learned from, and over those that it only judged.
    pub learned_from_rms: Option<f64>,
    pub judged_rms: Option<f64>,
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
    pub fn record(&self, gravity: f64, compared: Option<Compared>) -> Record {
        let Calibration {
            correction,
            sigma_bias,
            sigma_matrix,
            half_axes,
            coverage,
            weights,
            norm_rms,
            check_norm_rms,
        } = self.calibration;
        let (learned_from, judged) = (self.count(Role::Fit), self.count(Role::Check));
        Record {
            bias: correction.bias,
            matrix: correction.matrix,
            sigma_bias,
            sigma_matrix,
            scale: correction.scale_factors(),
            angles_deg: correction.angles_deg(),
            half_axes,
            attitudes: learned_from + judged,
            learned_from,
            judged,
            coverage,
            gravity,
            norm_rms_before: self.norm_rms_before,
            norm_rms_after: norm_rms,
            check_norm_rms_after: check_norm_rms,
            excess_rms: match weights {
                Weights::Noise => None,
                Weights::Excess(rms) => Some(rms * gravity),
            },
            compared,
            rejected: self.rejected.clone(),
        }
    }

    /// How the correction of another calibration, to its own gravity, fits the attitudes of this one.
    pub fn compared(&self, other: &Correction, of_other: f64, gravity: f64) -> Compared {
        let rms = |role| norm_rms(self.means(role), other, of_other).map(|rms| rms * gravity / of_other);
        Compared { learned_from_rms: rms(Role::Fit), judged_rms: rms(Role::Check) }
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

//! An accelerometer triad laid on its faces, each axis up and down: from a recording to its calibration.

use std::path::Path;

use calibration::ellipsoid::Correction;
use calibration::known_attitudes::{self, Attitudes, Calibration, Position, Refusal};
use serde::Serialize;

use super::attitudes::{self, AttitudesError, Dwell, Rejected};
use super::norm_fit::NormFit;

/// Readings, less their middle and over half of their range: an axis that reads more than this is upright …
const UPRIGHT: f64 = 0.9;
/// … while the others read less than this: 6°.
const LEVEL: f64 = 0.1;
/// An axis whose readings range over less than this part of the widest range was not laid both ways.
const LEAST_RANGE: f64 = 0.5;

/// A solved recording.
#[derive(Debug)]
pub struct Outcome {
    /// The attitudes that entered, and which way was up in each.
    pub laid: Vec<(Dwell, Face)>,
    pub calibration: Calibration,
    pub correction: Correction,
    pub sigma_matrix: [[f64; 3]; 3],
    /// The same by the norm of the readings.
    pub by_norm: Option<NormFit>,
    pub rejected: Vec<Rejected>,
}

/// An axis that points up or down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    pub up: bool,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum KnownAttitudesError {
    #[error(transparent)]
    Recording(#[from] AttitudesError),
    #[error("{file}: {reason}")]
    Refused { file: String, reason: Refusal },
}

/// The machine-readable result; field names are stable.
#[derive(Debug, Serialize)]
pub struct Record {
    pub bias: [f64; 3],
    /// Readings per unit of specific force along x, y, z.
    pub scale: [f64; 3],
    /// Specific force = matrix · (reading − bias).
    pub matrix: [[f64; 3]; 3],
    pub sigma_bias: [f64; 3],
    pub sigma_scale: [f64; 3],
    pub sigma_matrix: [[f64; 3]; 3],
    /// Whether misalignments were looked for.
    pub square: bool,
    pub gravity: f64,
    pub attitudes: usize,
    pub closures: u32,
    pub closure_rms: Option<f64>,
    /// Factor by which the standard deviations were widened.
    pub widened: f64,
    /// How far an upright axis leans at most, by what the others read then, degrees; and by how much it then reads too little, relative.
    pub greatest_lean_deg: f64,
    pub greatest_deficit: f64,
    /// Biases and scale factors by the norm of the readings, the axes taken as orthogonal.
    pub by_norm: Option<NormFit>,
    pub rejected: Vec<Rejected>,
}

/// Reads and solves a recording; `gravity` is the norm of specific force at rest, in the unit that is wanted.
pub fn calibrate(path: &Path, gravity: f64, attitudes: Attitudes) -> Result<Outcome, KnownAttitudesError> {
    let refused = |reason| KnownAttitudesError::Refused { file: path.display().to_string(), reason };
    let mut rejected = Vec::new();
    let dwells = attitudes::read(path, &mut rejected)?;
    let faces = faces(&dwells.iter().map(|dwell| dwell.attitude.mean).collect::<Vec<_>>()).map_err(refused)?;
    let mut laid = Vec::new();
    for (dwell, face) in dwells.into_iter().zip(faces) {
        match face {
            Some(face) => laid.push((dwell, face)),
            None => rejected.push(Rejected {
                attitude: dwell.number,
                t_s: dwell.t_s,
                readings: dwell.attitude.readings,
                why: "no axis is upright",
            }),
        }
    }
    let positions: Vec<_> =
        laid.iter().map(|(dwell, face)| Position { up: face.up(), attitude: dwell.attitude }).collect();
    let calibration = known_attitudes::solve(&positions, gravity, attitudes).map_err(refused)?;
    let (correction, sigma_matrix) =
        calibration.correction().ok_or(Refusal::Undetermined { axis: 0 }).map_err(refused)?;
    let means: Vec<_> = laid.iter().map(|(dwell, _)| dwell.attitude.mean).collect();
    let scale = [0, 1, 2].map(|axis| calibration.response[axis][axis]);
    let by_norm = NormFit::of(&means, gravity, NormFit { bias: calibration.bias, scale });
    Ok(Outcome { laid, calibration, correction, sigma_matrix, by_norm, rejected })
}

/// Which axis is upright in each attitude, and which way: by the readings themselves, whose sign is taken to be that of the
/// convention (up reads more than down). `None` for an attitude on no face.
fn faces(means: &[[f64; 3]]) -> Result<Vec<Option<Face>>, Refusal> {
    let ends = [0, 1, 2].map(|axis| {
        let of = || means.iter().map(|mean| mean[axis]);
        (of().fold(f64::INFINITY, f64::min), of().fold(f64::NEG_INFINITY, f64::max))
    });
    let ranges = ends.map(|(low, high)| high - low);
    let widest = ranges.into_iter().fold(0.0, f64::max);
    if let Some(axis) = ranges.iter().position(|range| range.is_nan() || *range <= LEAST_RANGE * widest) {
        return Err(Refusal::NotBothWays { axis });
    }
    let face = |mean: &[f64; 3]| {
        let parts = [0, 1, 2].map(|axis| (2.0 * mean[axis] - ends[axis].0 - ends[axis].1) / ranges[axis]);
        let axis = parts.iter().position(|part| part.abs() > UPRIGHT)?;
        let others_level = (0..3).all(|other| other == axis || parts[other].abs() < LEVEL);
        others_level.then_some(Face { axis, up: parts[axis] > 0.0 })
    };
    Ok(means.iter().map(face).collect())
}

impl Face {
    /// "+x" where x is up.
    pub fn name(self) -> String {
        format!("{}{}", if self.up { '+' } else { '-' }, ["x", "y", "z"][self.axis])
    }

    /// Which way is up, along x, y, z of the box.
    fn up(self) -> [f64; 3] {
        let mut up = [0.0; 3];
        up[self.axis] = if self.up { 1.0 } else { -1.0 };
        up
    }
}

impl Outcome {
    /// By how much an upright axis that leans reads too little at most, relative: half of the square of the lean.
    pub fn greatest_deficit(&self) -> f64 {
        self.calibration.greatest_lean_rad.powi(2) / 2.0
    }

    /// The machine-readable result.
    pub fn record(&self, gravity: f64, square: bool) -> Record {
        let Calibration { bias, response, sigma_bias, sigma_response, closure, .. } = self.calibration;
        Record {
            bias,
            scale: [0, 1, 2].map(|axis| response[axis][axis]),
            matrix: self.correction.matrix,
            sigma_bias,
            sigma_scale: [0, 1, 2].map(|axis| sigma_response[axis][axis]),
            sigma_matrix: self.sigma_matrix,
            square,
            gravity,
            attitudes: self.laid.len(),
            closures: closure.count,
            closure_rms: closure.rms,
            widened: closure.widened,
            greatest_lean_deg: self.calibration.greatest_lean_rad.to_degrees(),
            greatest_deficit: self.greatest_deficit(),
            by_norm: self.by_norm,
            rejected: self.rejected.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_told_from_counts_with_large_offsets() {
        let means = [
            [37_000.0, 33_100.0, 32_500.0],
            [29_000.0, 33_000.0, 32_400.0],
            [33_000.0, 37_200.0, 32_450.0],
            [33_010.0, 29_000.0, 32_450.0],
            [33_000.0, 33_050.0, 36_500.0],
            [33_000.0, 33_050.0, 28_400.0],
            [35_800.0, 35_900.0, 32_450.0],
        ];
        let faces = faces(&means).unwrap();
        let names: Vec<_> = faces.iter().map(|face| face.map_or("none".into(), Face::name)).collect();
        assert_eq!(names, ["+x", "-x", "+y", "-y", "+z", "-z", "none"]);
    }

    #[test]
    fn an_axis_that_was_never_turned_over_is_named() {
        let means = [[1.0, 0.0, 0.01], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.98]];
        // Up alone, z ranges over 0.98 of the 2 g of the others: no more than half.
        assert_eq!(faces(&means), Err(Refusal::NotBothWays { axis: 2 }));
        assert_eq!(faces(&means[..4]), Err(Refusal::NotBothWays { axis: 2 }));
        assert_eq!(faces(&[]), Err(Refusal::NotBothWays { axis: 0 }));
    }
}

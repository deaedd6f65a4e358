//! Calibrations as files: `format = 1` and a table for each triad that was calibrated.

use std::fs;
use std::path::Path;

use north_finder::calibration::ellipsoid::{self, Correction};
use north_finder::calibration::six_position;
use serde::{Deserialize, Serialize};

use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

const FORMAT: i64 = 1;

/// The tables of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometer: Option<Accelerometer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_triad: Option<GyroTriad>,
}

/// Specific force = matrix · (reading − bias), in the unit of `gravity`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accelerometer {
    /// What |specific force| is at rest.
    pub gravity: f64,
    pub bias: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_bias: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_matrix: Option<[[f64; 3]; 3]>,
}

/// Output = bias + matrix · true rate, °/h.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroTriad {
    pub bias_deg_h: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_bias_deg_h: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_matrix: Option<[[f64; 3]; 3]>,
}

impl CalibrationFile {
    /// Of an accelerometer triad.
    pub fn of_accelerometer(calibration: &ellipsoid::Calibration, gravity: f64) -> Self {
        let ellipsoid::Calibration { correction, sigma_bias, sigma_matrix, .. } = *calibration;
        let accelerometer = Accelerometer {
            gravity,
            bias: correction.bias,
            matrix: correction.matrix,
            sigma_bias: Some(sigma_bias),
            sigma_matrix: Some(sigma_matrix),
        };
        Self { accelerometer: Some(accelerometer), gyro_triad: None }
    }

    /// Of a gyro triad.
    pub fn of_gyros(calibration: &six_position::Calibration) -> Self {
        let six_position::Calibration { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix, .. } = *calibration;
        let gyro_triad = GyroTriad {
            bias_deg_h,
            matrix,
            sigma_bias_deg_h: Some(sigma_bias_deg_h),
            sigma_matrix: Some(sigma_matrix),
        };
        Self { accelerometer: None, gyro_triad: Some(gyro_triad) }
    }

    /// Reads a file.
    ///
    /// Errors: no such file, not TOML, another format, unknown keys.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        TomlFile::read(path)?.parse_format(FORMAT)
    }

    /// Writes a file, over one that may be there.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let tables =
            toml::to_string(self).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
        fs::write(path, format!("format = {FORMAT}\n\n{tables}")).map_err(|error| FileError::whole(path, error))
    }
}

impl Accelerometer {
    /// As the core applies it.
    pub fn correction(&self) -> Correction {
        Correction { bias: self.bias, matrix: self.matrix }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let accelerometer = Accelerometer {
            gravity: 9.81,
            bias: [0.1, -1e-7, 32_768.125],
            matrix: [[1.0, 0.25, 0.0], [0.0, 1.0, 1.0 / 3.0], [0.0, 0.0, 1.0]],
            sigma_bias: None,
            sigma_matrix: None,
        };
        let file = CalibrationFile { accelerometer: Some(accelerometer), gyro_triad: None };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.toml");
        file.write(&path).unwrap();
        assert_eq!(CalibrationFile::read(&path).unwrap(), file);
    }
}

//! The calibration of the level accelerometers.

use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::ellipsoid::Correction;

/// What turns readings of the accelerometer triad into specific force: f = M · (reading − bias), all in g.
///
/// M is upper triangular: the triad's own z axis is taken for the instrument's, and x and y are put square to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelerometerCalibration {
    /// What x, y and z read without specific force, g, −0.5 … 0.5.
    pub bias_g: [f64; 3],
    /// m11, m12, m13, m22, m23, m33: the diagonal 0.8 … 1.25, the others −0.2 … 0.2.
    pub matrix: [f64; 6],
}

impl AccelerometerCalibration {
    /// Of accelerometers that read what they feel.
    pub const UNIT: Self = Self { bias_g: [0.0; 3], matrix: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0] };

    /// Of a correction in g.
    pub fn new(correction: &Correction) -> Self {
        let [[m11, m12, m13], [_, m22, m23], [_, _, m33]] = correction.matrix;
        Self { bias_g: correction.bias, matrix: [m11, m12, m13, m22, m23, m33] }
    }

    /// As it is applied.
    pub fn correction(&self) -> Correction {
        let [m11, m12, m13, m22, m23, m33] = self.matrix;
        Correction { bias: self.bias_g, matrix: [[m11, m12, m13], [0.0, m22, m23], [0.0, 0.0, m33]] }
    }

    /// Checks every value.
    pub fn validate(&self) -> Result<(), Invalid> {
        let [m11, m12, m13, m22, m23, m33] = self.matrix;
        let check = |field, values: [f64; 3], low: f64, high: f64, allowed| {
            let wrong = values.into_iter().find(|value| !(low..=high).contains(value));
            wrong.map_or(Ok(()), |value| Err(Invalid::new(field, value, allowed)))
        };
        check("accelerometer.bias_g", self.bias_g, -0.5, 0.5, "-0.5 to 0.5")?;
        check("accelerometer.matrix", [m11, m22, m33], 0.8, 1.25, "0.8 to 1.25 on the diagonal")?;
        check("accelerometer.matrix", [m12, m13, m23], -0.2, 0.2, "-0.2 to 0.2 off the diagonal")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIAD: AccelerometerCalibration =
        AccelerometerCalibration { bias_g: [0.01, -0.02, 0.0], matrix: [1.01, 0.002, 0.0, 1.0, 0.003, 0.99] };

    #[test]
    fn readings_are_corrected_by_hand() {
        // A bias of +0.01 g on x: level, x reads +0.01 g, and the force along x is 0.
        let bias = AccelerometerCalibration { bias_g: [0.01, 0.0, 0.0], matrix: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0] };
        assert_eq!(bias.correction().apply([0.01, 0.0, 1.0]), [0.0, 0.0, 1.0]);
        // Rows of M from the left: x gets 0.002 of y, y gets 0.003 of z.
        let [x, y, z] = TRIAD.correction().apply([0.01, 0.98, 1.0]);
        assert!((x - 0.002).abs() < 1e-15 && (y - 1.003).abs() < 1e-15 && (z - 0.99).abs() < 1e-15);
        assert_eq!(AccelerometerCalibration::new(&TRIAD.correction()), TRIAD);
    }

    #[test]
    fn what_no_triad_has_is_refused_by_name() {
        assert_eq!(TRIAD.validate(), Ok(()));
        let field = |triad: AccelerometerCalibration| triad.validate().unwrap_err().field;
        assert_eq!(field(AccelerometerCalibration { bias_g: [0.0, 0.6, 0.0], ..TRIAD }), "accelerometer.bias_g");
        assert_eq!(field(AccelerometerCalibration { bias_g: [f64::NAN; 3], ..TRIAD }), "accelerometer.bias_g");
        for (place, value) in [(0, 0.0), (3, -1.0), (5, 1.3), (1, 0.3), (2, -0.3), (4, f64::INFINITY)] {
            let mut matrix = TRIAD.matrix;
            matrix[place] = value;
            assert_eq!(field(AccelerometerCalibration { matrix, ..TRIAD }), "accelerometer.matrix");
        }
    }
}

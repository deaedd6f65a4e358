//! What is known of the horizontal rate beside the samples: rows that tie a run's own unknowns (h cos ψ, h sin ψ, bias).

use nalgebra::{Matrix3, Vector3};

/// One sigma of the amplitude about Ω cos φ, relative: of the scale factor and of the latitude.
pub const AMPLITUDE_SIGMA: f64 = 0.002;

/// A row of the equations of a run's own unknowns that is known beside the samples, in standard deviations of what is known.
#[derive(Clone, Copy, Debug)]
pub struct Tie {
    pub row: Vector3<f64>,
    pub value: f64,
}

impl Tie {
    /// The horizontal rate along an azimuth is Ω cos φ: right to the second order in the azimuth's error, and independent of it.
    pub fn amplitude(azimuth_rad: f64, north_deg_h: f64) -> Self {
        let (sin, cos) = azimuth_rad.sin_cos();
        let along = 1.0 / (north_deg_h * AMPLITUDE_SIGMA);
        Self { row: Vector3::new(cos * along, sin * along, 0.0), value: north_deg_h * along }
    }
}

/// Adds what is known of the horizontal rate.
pub fn tie_down(ties: &[Tie], normal: &mut Matrix3<f64>, right: &mut Vector3<f64>, square: &mut f64) {
    for Tie { row, value } in ties {
        *normal += row * row.transpose();
        *right += row * *value;
        *square += value * value;
    }
}

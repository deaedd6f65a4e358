//! A sinusoidal disturbance of the rate whose phase is another in every fix: a motor, a pump, a building that sways.
//!
//! No model can foretell it, but its period can be known, and its two parts, A cos 2πt/T + B sin 2πt/T, estimated beside
//! azimuth, bias and drift from the means and slopes of the dwells. They are held about zero with the spread that the
//! known amplitude gives them, A²/2 each, so that a sinusoid which the dwells cannot tell from the azimuth leaves an
//! uncertainty and no singular equations.

use core::f64::consts::TAU;

use nalgebra::{Matrix2, Matrix4, SMatrix, Vector2};

use super::dwell::DwellSummary;
use super::observation::{Observation, regular_inverse};
use crate::effects::Sinusoid;

/// A sinusoid with its parts in this fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    sinusoid: Sinusoid,
    parts_deg_h: Vector2<f64>,
    /// What the parts' uncertainty adds to the inverse normal matrix of the other unknowns.
    pub doubt: Matrix4<f64>,
}

impl Fitted {
    /// What it adds to a dwell's mean rate, °/h, and to its slope, °/h per hour.
    pub fn of_dwell(&self, dwell: &DwellSummary) -> [f64; 2] {
        columns(&self.sinusoid, dwell).map(|column| column.dot(&self.parts_deg_h))
    }
}

impl Fitted {
    /// Estimates the parts. `variance` is that of a one-second rate, (°/h)², `drift_weight` as for the other unknowns.
    pub(super) fn new(
        sinusoid: Sinusoid,
        dwells: &[DwellSummary],
        observations: &dyn Fn(&DwellSummary) -> [Observation; 2],
        variance: f64,
        drift_weight: f64,
    ) -> Option<Self> {
        let mut others = Matrix4::zeros();
        let mut shared = SMatrix::<f64, 4, 2>::zeros();
        let mut own = Matrix2::identity() * (2.0 * variance / (sinusoid.amplitude_deg_h * sinusoid.amplitude_deg_h));
        let (mut right, mut own_right) = (nalgebra::Vector4::zeros(), Vector2::zeros());
        others.m44 += drift_weight;
        for dwell in dwells {
            let columns = columns(&sinusoid, dwell);
            for (observation, column) in observations(dwell).into_iter().zip(columns) {
                let (weight, row) = (observation.weight, observation.row);
                observation.add_to(&mut others, &mut right);
                shared += weight * row * column.transpose();
                own += weight * column * column.transpose();
                own_right += weight * observation.rate_deg_h * column;
            }
        }
        // By elimination of the others.
        let inverse = regular_inverse(&others)?;
        let gain = inverse * shared;
        let covariance = (own - shared.transpose() * gain).try_inverse()?;
        let parts_deg_h = covariance * (own_right - gain.transpose() * right);
        Some(Self { sinusoid, parts_deg_h, doubt: gain * covariance * gain.transpose() })
    }
}

/// Cosine and sine of the sinusoid in a dwell: their means, and their slopes per hour.
fn columns(sinusoid: &Sinusoid, dwell: &DwellSummary) -> [Vector2<f64>; 2] {
    let omega = TAU / sinusoid.period_s;
    let middle_s = 0.5 * (dwell.start_s + dwell.end_s);
    let (sin, cos) = libm::sincos(omega * middle_s);
    // Over u in ± half: the mean of cos ωu, and the least-squares slope of sin ωu, 3/(2 half³) ∫ u sin ωu du.
    let x = 0.5 * omega * (dwell.end_s - dwell.start_s);
    let (mean, slope) = if x > 1e-3 {
        let (s, c) = libm::sincos(x);
        (s / x, omega * 3.0 * (s - x * c) / (x * x * x))
    } else {
        (1.0, omega)
    };
    let per_hour = 3600.0 * slope;
    [Vector2::new(cos * mean, sin * mean), Vector2::new(-sin * per_hour, cos * per_hour)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dwell from 10 s to 20 s of a sinusoid of 40 s: from a quarter to half of a period. The cosine falls from 0 to −1: its
    /// mean is −2/π. Its least-squares slope, by numerical integration of 12/T³ ∫ (t − 15) cos, is -0.104370 a second.
    #[test]
    fn means_and_slopes_by_hand() {
        let dwell = DwellSummary { start_s: 10.0, end_s: 20.0, ..DwellSummary::default() };
        let [mean, slope] = columns(&Sinusoid { period_s: 40.0, amplitude_deg_h: 1.0 }, &dwell);
        assert!((mean.x + core::f64::consts::FRAC_2_PI).abs() < 1e-12);
        assert!((mean.y - core::f64::consts::FRAC_2_PI).abs() < 1e-12);
        assert!((slope.x / 3600.0 + 0.1043698).abs() < 1e-6, "{}", slope.x / 3600.0);
    }
}

//! What latitude the data say, without the calibration's help.

use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2, Vector4};
use quantities::earth::{EARTH_RATE_DEG_H, POLE_LIMIT_DEG};
use quantities::units::{DEG_PER_RAD, RAD_PER_DEG};

use super::{Closure, LEAST_CLOSURE_P, Measured, Observation, Refusal, Solution};

/// What matrix elements are taken to be within, one standard deviation, apart from a common scale factor.
const ELEMENT_SIGMA: f64 = 0.007;
/// What the common scale factor is taken to be within, one standard deviation.
const COMMON_SIGMA: f64 = 0.1;
/// What biases are taken to be within, one standard deviation, °/h.
const BIAS_SIGMA_DEG_H: f64 = 1e3;
/// Standard deviations by which the latitude must be off.
const LIMIT_SIGMAS: f64 = 4.0;
/// Iterations of the solution for the latitude.
const ITERATIONS: usize = 30;

/// A latitude with its standard deviation, degrees.
struct Found {
    latitude_deg: f64,
    sigma_deg: f64,
}

impl Measured<'_> {
    /// Whether the latitude is what contradicts the data: it is off by more than the data's uncertainty, and either the
    /// closure says nothing else or it is noise with the other latitude.
    pub(super) fn refuse_latitude(&self, solution: &Solution) -> Result<(), Refusal> {
        let declared_deg = self.knowledge.latitude_deg;
        let Some(found) = self.latitude() else { return Ok(()) };
        if (found.latitude_deg - declared_deg).abs() <= LIMIT_SIGMAS * found.sigma_deg {
            return Ok(());
        }
        let is_noise = |closure: Closure| closure.p_value.is_none_or(|p_value| p_value >= LEAST_CLOSURE_P);
        let explains = is_noise(solution.closure())
            || self.solve_at(found.latitude_deg, None).is_some_and(|other| is_noise(other.closure()));
        if explains {
            let Found { latitude_deg: found_deg, sigma_deg } = found;
            return Err(Refusal::LatitudeContradicts { declared_deg, found_deg, sigma_deg });
        }
        Ok(())
    }

    /// Gauss-Newton for the latitude and a common scale factor, with the twelve parameters as nuisances of which a little
    /// is known beforehand.
    fn latitude(&self) -> Option<Found> {
        let most_deg = 90.0 - POLE_LIMIT_DEG;
        let (mut latitude_deg, mut common) = (self.knowledge.latitude_deg, 0.0);
        let mut covariance = Matrix2::zeros();
        for _ in 0..ITERATIONS {
            let mut normal = Matrix2::new(0.0, 0.0, 0.0, 1.0 / (COMMON_SIGMA * COMMON_SIGMA));
            let mut right = Vector2::new(0.0, -common / (COMMON_SIGMA * COMMON_SIGMA));
            for gyro in 0..3 {
                let (information, pull) = self.step(gyro, latitude_deg, common)?;
                normal += information;
                right += pull;
            }
            covariance = normal.try_inverse()?;
            let &[rad, scale] = (covariance * right).as_ref();
            // A step of more than half a radian leaves the range in which it means something.
            latitude_deg = (latitude_deg + rad.clamp(-0.5, 0.5) * DEG_PER_RAD).clamp(-most_deg, most_deg);
            common += scale.clamp(-0.5, 0.5);
            if rad.abs() < 1e-9 && scale.abs() < 1e-9 {
                break;
            }
        }
        let sigma_deg = libm::sqrt(covariance.m11) * DEG_PER_RAD;
        (sigma_deg.is_finite() && latitude_deg.is_finite()).then_some(Found { latitude_deg, sigma_deg })
    }

    /// One gyro's part of the normal equations for latitude (rad) and common scale, its own parameters eliminated.
    fn step(&self, gyro: usize, latitude_deg: f64, common: f64) -> Option<(Matrix2<f64>, Vector2<f64>)> {
        // Rows are in units of the Earth rate, so that these parameters are responses times Ω.
        let response = ELEMENT_SIGMA * EARTH_RATE_DEG_H;
        let prior = [BIAS_SIGMA_DEG_H, response, response, response].map(|sigma| 1.0 / (sigma * sigma));
        let mut own = Matrix4::from_diagonal(&Vector4::from(prior));
        let mut between = Matrix4x2::zeros();
        let (mut shared, mut pull) = (Matrix2::zeros(), Vector2::zeros());
        let mut own_pull = Vector4::zeros();
        let later_deg = latitude_deg + 1e-6;
        let earlier_deg = latitude_deg - 1e-6;
        let change = self.observations(gyro, later_deg).zip(self.observations(gyro, earlier_deg));
        for (observation, (later, earlier)) in self.observations(gyro, latitude_deg).zip(change) {
            let Observation { row, rate_deg_h, variance } = observation;
            let input = |observation: &Observation| {
                let &[_, x, y, z] = observation.row.as_ref();
                EARTH_RATE_DEG_H * super::part(&[x, y, z], gyro)
            };
            let by_rad = (1.0 + common) * (input(&later) - input(&earlier)) / (2e-6 * RAD_PER_DEG);
            let slopes = Vector2::new(by_rad, input(&observation));
            let left = rate_deg_h - (1.0 + common) * input(&observation);
            own += row * row.transpose() / variance;
            between += row * slopes.transpose() / variance;
            shared += slopes * slopes.transpose() / variance;
            own_pull += row * (left / variance);
            pull += slopes * (left / variance);
        }
        let eliminate = own.cholesky()?.inverse();
        Some((shared - between.transpose() * eliminate * between, pull - between.transpose() * eliminate * own_pull))
    }
}

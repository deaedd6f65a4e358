//! What the gyros sum up while the instrument stands before there is a heading: when it comes, their biases are known.

use nalgebra::Vector3;
use quantities::earth::EARTH_RATE_DEG_H;

use crate::coning::LONGEST_SAMPLE_S;

use super::{BlockClass, GRAVITY_M_S2, MOTION_M_S2, MOTION_SIGMAS, RAD_PER_ARCSEC, RAD_S_PER_DEG_H, SECOND_S, square};
use crate::Increment;

/// A second's turn beyond what bias, noise and the Earth make of it is a sway up to this, arcsec; more is a motion.
const SWAY_ARCSEC: f64 = 60.0;
/// Shorter standing says nothing of a bias, s.
const LEAST_S: f64 = 10.0;

/// Sums since the last motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stood {
    seconds: f64,
    angle_rad: Vector3<f64>,
    /// Of the second in the making: length, turn, velocity.
    second: (f64, Vector3<f64>, Vector3<f64>),
}

impl Stood {
    /// A sample of `dt_s`. A second with a motion in it begins anew.
    pub fn push(&mut self, class: &BlockClass, dt_s: f64, sample: &Increment) {
        let finite = sample.angle_rad.iter().chain(sample.velocity_m_s.iter()).all(|part| part.is_finite());
        if !(finite && dt_s > 0.0 && dt_s <= LONGEST_SAMPLE_S) {
            return self.interrupt();
        }
        let (length_s, angle_rad, velocity_m_s) = &mut self.second;
        *length_s += dt_s;
        *angle_rad += sample.angle_rad;
        *velocity_m_s += sample.velocity_m_s;
        if *length_s < SECOND_S - 0.5 * dt_s {
            return;
        }
        let (length_s, angle_rad, velocity_m_s) = core::mem::take(&mut self.second);
        let white = class.arw_deg_sqrt_h * 60.0 * RAD_S_PER_DEG_H;
        let bias = square(class.run_to_run_deg_h * RAD_S_PER_DEG_H) + square(class.markov_deg_h * RAD_S_PER_DEG_H);
        let still_rad = MOTION_SIGMAS * libm::sqrt(bias + square(white))
            + EARTH_RATE_DEG_H * RAD_S_PER_DEG_H
            + SWAY_ARCSEC * RAD_PER_ARCSEC;
        let shaken_m_s2 = libm::fabs((velocity_m_s / length_s).norm() - GRAVITY_M_S2);
        if angle_rad.amax() > still_rad || shaken_m_s2 > MOTION_M_S2 {
            return self.interrupt();
        }
        self.seconds += length_s;
        self.angle_rad += angle_rad;
    }

    /// Samples are missing, or it moves.
    pub fn interrupt(&mut self) {
        *self = Self::default();
    }

    /// Mean rate, rad/s, block axes, and the time it was gathered in, s.
    pub(super) fn mean_rate(&self) -> Option<(Vector3<f64>, f64)> {
        (self.seconds >= LEAST_S).then(|| (self.angle_rad / self.seconds, self.seconds))
    }
}

//! Least squares along a window, block by block: a Kalman filter of velocity, specific force and its slope.
//!
//! In inertial axes the three of them obey v' = f + (white force), f' = s + g (white rate), s' = 0, the same along every axis; a
//! block's mean velocity is measured with the base's own white velocity. Which noise is believed decides the gains, which
//! noise is there the variance of the result (Gelb, Applied Optimal Estimation, 1974, section 7.2: Joseph's form holds for any
//! gain).

use nalgebra::{Matrix3, RowVector3, Vector3};

use super::noise::Noise;

/// Of velocity, m/s, force, m/s², and slope, m/s³, at the start, where nothing is known.
const START: Vector3<f64> = Vector3::new(1.0, 1.0, 1e-2);
/// Blocks that fill the state; the others judge the noise.
const FILLING: u32 = 3;

/// What a window gives.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tracked {
    /// At the window's start, m/s².
    pub(super) force: Vector3<f64>,
    /// m/s³.
    pub(super) slope: Vector3<f64>,
    /// Of force, (m/s²)², and slope, (m/s³)², along each axis.
    pub(super) force_variance: f64,
    pub(super) slope_variance: f64,
    /// Of the noise that is there, if it is also the one that is believed.
    pub(super) log_likelihood: f64,
}

/// Blocks with a velocity and its variance, local and mean; `up` carries no rate, `gravity` makes a force of a tilt.
pub(super) fn track(
    blocks: impl Iterator<Item = (Vector3<f64>, [f64; 2])>,
    step_s: f64,
    up: &Vector3<f64>,
    gravity: f64,
    believed: &Noise,
    actual: &Noise,
) -> Tracked {
    let transition = Matrix3::new(1.0, step_s, 0.5 * step_s * step_s, 0.0, 1.0, step_s, 0.0, 0.0, 1.0);
    // Of the state at the block's start: the mean velocity over it.
    let row = RowVector3::new(1.0, 0.5 * step_s, step_s * step_s / 6.0);
    let start = Matrix3::from_diagonal(&START.component_mul(&START));
    // Rows velocity, force, slope at the end of a block; columns the axes.
    let mut state = Matrix3::<f64>::zeros();
    let (mut of_gain, mut of_error) = (start, start);
    let (mut log_likelihood, mut count) = (0.0, 0u32);
    for (velocity, loudness) in blocks {
        if count == 0 {
            state.set_row(0, &velocity.transpose());
        }
        let [believed, actual] = [believed, actual].map(|noise| Added::new(noise, &loudness, step_s, gravity));
        let gain = (transition * of_gain * row.transpose() + believed.cross) / believed.variance(&of_gain, &row);
        let innovation = velocity.transpose() - row * state;
        if count >= FILLING {
            let variance = actual.variance(&of_error, &row);
            let upwards = (innovation * up).x;
            log_likelihood -= 0.5 * (innovation.norm_squared() - upwards * upwards) / variance + libm::log(variance);
        }
        state = transition * state + gain * innovation;
        let keep = transition - gain * row;
        of_gain = believed.grown(&(keep * of_gain * keep.transpose()), &gain);
        of_error = actual.grown(&(keep * of_error * keep.transpose()), &gain);
        count += 1;
    }
    let back_s = step_s * f64::from(count);
    let (force, slope) = (state.row(1).transpose(), state.row(2).transpose());
    Tracked {
        force: force - slope * back_s,
        slope,
        force_variance: of_error.m22,
        slope_variance: of_error.m33,
        log_likelihood,
    }
}

/// What the noise adds in a block of length T.
struct Added {
    /// To the state at its end.
    state: Matrix3<f64>,
    /// To its mean velocity.
    mean: f64,
    /// Covariance of both.
    cross: Vector3<f64>,
}

impl Added {
    /// White force a² adds w = ∫ (T − τ)/T a dτ to the mean and v = ∫ a dτ: variances a²T/3 and a²T, covariance a²T/2. White
    /// rate, g²n², adds v = ∫ (T − τ) n dτ, f = ∫ n dτ, w = ∫ (T − τ)²/2T n dτ.
    fn new(noise: &Noise, [local, mean]: &[f64; 2], step_s: f64, gravity: f64) -> Self {
        let loud = if noise.local { *local } else { *mean };
        let force = noise.force * loud;
        let tilt = gravity * gravity * noise.rate * step_s;
        let (vv, vf) = (tilt * step_s * step_s / 3.0 + force, 0.5 * tilt * step_s);
        Self {
            state: Matrix3::new(vv, vf, 0.0, vf, tilt, 0.0, 0.0, 0.0, 0.0),
            mean: tilt * step_s * step_s / 20.0 + force / 3.0 + noise.velocity * loud,
            cross: Vector3::new(tilt * step_s * step_s / 8.0 + 0.5 * force, tilt * step_s / 6.0, 0.0),
        }
    }

    /// Of the innovation.
    fn variance(&self, covariance: &Matrix3<f64>, row: &RowVector3<f64>) -> f64 {
        (row * covariance * row.transpose()).x + self.mean
    }

    fn grown(&self, kept: &Matrix3<f64>, gain: &Vector3<f64>) -> Matrix3<f64> {
        let across = gain * self.cross.transpose();
        kept + self.state + gain * gain.transpose() * self.mean - across - across.transpose()
    }
}

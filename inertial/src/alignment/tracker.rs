//! Least squares along a window, block by block: a Kalman filter of what the accelerometers and the gyros say of the support.
//!
//! In inertial axes velocity v, specific force f and its slope s obey v' = f + (white force), f' = s + g (white rate), s' = 0, the
//! same along every axis; a block's mean velocity is measured with the base's own white velocity. The gyros alone say where the
//! support e would be if the base stood: e' = s + c + g (white rate) + g (white turn of the base), where c is g times its drift, c' = 0,
//! measured with the base's jitter. The noise of the gyros is in f and in e. A base that turns as it likes leaves the accelerometers alone to tell the slope, one that stands makes the mean of the
//! gyros' rates of it (Gelb, Applied Optimal Estimation, 1974, section 4.5: correlated noise).

use nalgebra::{Matrix2, Matrix2x3, SMatrix, SVector, Vector3};

use super::noise::{Base, Noise};

/// Of velocity, m/s, force, m/s², slope, m/s³, and support, m/s², at the start, where nothing is known; the drift is the base's.
const START: [f64; 4] = [1.0, 1.0, 1e-2, 1.0];
/// Blocks that fill the state; the others judge the noise.
const FILLING: u32 = 3;
/// Velocities and angles are rounded to this at the best, m/s and rad: blocks without any noise would leave matrices without an inverse.
const ROUNDING_M_S: f64 = 1e-6;
const ROUNDING_RAD: f64 = 1e-8;

const STATES: usize = 5;
type Covariance = SMatrix<f64, STATES, STATES>;
type Columns = SMatrix<f64, STATES, 2>;

/// A block's means, with their variances by the differences around it (local) and by all of them (mean).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Measured {
    /// m/s.
    pub(super) velocity: Vector3<f64>,
    /// By the gyros, m/s².
    pub(super) support: Vector3<f64>,
    /// Of velocity, (m/s)²: local, mean.
    pub(super) velocity_variance: [f64; 2],
    /// Of support, (m/s²)²: local, mean.
    pub(super) support_variance: [f64; 2],
}

/// What a window gives.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tracked {
    /// At the window's start, as it is seen from its end, m/s².
    pub(super) force: Vector3<f64>,
    /// m/s³.
    pub(super) slope: Vector3<f64>,
    /// Of force, (m/s²)², and slope, (m/s³)², along each axis.
    pub(super) force_variance: f64,
    pub(super) slope_variance: f64,
    pub(super) log_likelihood: f64,
}

/// `up` carries no rate, `gravity` makes a force of a tilt.
pub(super) fn track<'a>(
    blocks: impl Iterator<Item = &'a Measured>,
    step_s: f64,
    up: &Vector3<f64>,
    gravity: f64,
    noise: &Noise,
    base: &Base,
) -> Tracked {
    let model = Model { step_s };
    let [v, f, s, e] = START.map(|sigma| sigma * sigma);
    let drift = gravity * base.drift_rad_s;
    let mut covariance = Covariance::from_diagonal(&SVector::from([v, f, s, e, drift * drift]));
    let mut state = SMatrix::<f64, STATES, 3>::zeros();
    let (mut log_likelihood, mut count) = (0.0, 0u32);
    for block in blocks {
        if count == 0 {
            state.set_row(0, &block.velocity.transpose());
        }
        let added = Added::new(noise, base, block, step_s, gravity);
        // The covariance is symmetric: H P is the transpose of P Hᵀ.
        let seen = model.observe(&covariance).transpose();
        let spread = model.observe(&seen) + added.measured;
        let Some(inverse) = spread.try_inverse() else { continue };
        let reach = model.advance(&seen) + added.cross;
        let gain = reach * inverse;
        let innovation =
            Matrix2x3::from_rows(&[block.velocity.transpose(), block.support.transpose()]) - model.observe(&state);
        if count >= FILLING {
            let upwards = innovation * up;
            let across = innovation - upwards * up.transpose();
            log_likelihood -= 0.5 * (inverse * across * across.transpose()).trace() + libm::log(spread.determinant());
        }
        state = model.advance(&state) + gain * innovation;
        // Rounding would make the covariance less and less symmetric.
        let later = model.advance(&model.advance(&covariance).transpose()) + added.state - gain * reach.transpose();
        covariance = 0.5 * (later + later.transpose());
        count += 1;
    }
    let row = |number: usize| -> Vector3<f64> { state.row(number).transpose() };
    let (force, slope): (Vector3<f64>, Vector3<f64>) = (row(1), row(2));
    let [[_, force_variance, slope_variance, ..]] = covariance.diagonal().data.0;
    Tracked {
        force: force - slope * (step_s * f64::from(count)),
        slope,
        force_variance,
        slope_variance,
        log_likelihood,
    }
}

/// Of the state at a block's start, column by column.
struct Model {
    step_s: f64,
}

impl Model {
    /// The state a block later.
    fn advance<const N: usize>(&self, columns: &SMatrix<f64, STATES, N>) -> SMatrix<f64, STATES, N> {
        let mut later = *columns;
        for [velocity, force, slope, support, drift] in &mut later.data.0 {
            *velocity += self.step_s * (*force + 0.5 * self.step_s * *slope);
            *force += self.step_s * *slope;
            *support += self.step_s * (*slope + *drift);
        }
        later
    }

    /// Mean velocity and mean support over the block.
    fn observe<const N: usize>(&self, columns: &SMatrix<f64, STATES, N>) -> SMatrix<f64, 2, N> {
        let half_s = 0.5 * self.step_s;
        let mut means = SMatrix::<f64, 2, N>::zeros();
        for ([velocity, force, slope, support, drift], mean) in columns.data.0.iter().zip(&mut means.data.0) {
            *mean = [velocity + half_s * (force + self.step_s / 3.0 * slope), support + half_s * (slope + drift)];
        }
        means
    }
}

/// What the noise adds in a block of length T.
struct Added {
    /// To the state at its end.
    state: Covariance,
    /// To its means of velocity and support.
    measured: Matrix2<f64>,
    /// Covariance of both.
    cross: Columns,
}

impl Added {
    /// White force a² adds w = ∫ (T − τ)/T a dτ to the mean and v = ∫ a dτ: variances a²T/3 and a²T, covariance a²T/2. White
    /// rate, g²n², adds v = ∫ (T − τ) n dτ, f = e = ∫ n dτ, w = ∫ (T − τ)²/2T n dτ, and ∫ (T − τ)/T n dτ to the mean support. White
    /// turn adds the same to e and to the mean support.
    fn new(noise: &Noise, base: &Base, block: &Measured, step_s: f64, gravity: f64) -> Self {
        let loud = |[local, mean]: [f64; 2]| if noise.local { local } else { mean };
        let (velocity, jitter) = (loud(block.velocity_variance), loud(block.support_variance) * base.jitter);
        let g2 = gravity * gravity;
        let force = noise.force * velocity;
        let tilt = g2 * noise.rate * step_s;
        let turn = g2 * base.walk_rad2_s * step_s;
        let (vv, vf) = (tilt * step_s * step_s / 3.0 + force, 0.5 * tilt * step_s);
        let state = Covariance::from([
            [vv, vf, 0.0, vf, 0.0],
            [vf, tilt, 0.0, tilt, 0.0],
            [0.0; STATES],
            [vf, tilt, 0.0, tilt + turn, 0.0],
            [0.0; STATES],
        ]);
        let mean =
            tilt * step_s * step_s / 20.0 + force / 3.0 + noise.velocity * velocity + ROUNDING_M_S * ROUNDING_M_S;
        let support = (tilt + turn) / 3.0 + jitter + g2 * ROUNDING_RAD * ROUNDING_RAD;
        let between = tilt * step_s / 8.0;
        let cross = Columns::from([
            [tilt * step_s * step_s / 8.0 + 0.5 * force, tilt * step_s / 6.0, 0.0, tilt * step_s / 6.0, 0.0],
            [tilt * step_s / 3.0, 0.5 * tilt, 0.0, 0.5 * (tilt + turn), 0.0],
        ]);
        Self { state, measured: Matrix2::new(mean, between, between, support), cross }
    }
}

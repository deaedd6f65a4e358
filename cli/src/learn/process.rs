//! A process of every run's own beside white noise, by state space: a Kalman filter makes independent what it makes dependent.

use north_finder::effects::doubt::{Kernel, Process};

/// The rows of one run: their middle, when the index had come to rest before each, s, and their variance, (°/h)².
#[derive(Clone, Copy)]
pub struct Instants<'a> {
    pub t_s: &'a [f64],
    pub rests_s: &'a [f64],
    pub variance: &'a [f64],
}

/// What makes the rows of one run independent, of variance 1: the same linear filter for every column.
pub struct Whitener {
    steps: Vec<Step>,
    /// Logarithm of the determinant of the rows' covariance.
    pub log_determinant: f64,
}

#[derive(Clone, Copy)]
struct Step {
    /// Transition to this row, row by row.
    transition: [[f64; 2]; 2],
    gain: [f64; 2],
    /// One over the innovation's standard deviation.
    inverse: f64,
}

impl Whitener {
    /// Of rows with white noise and the process, if there is one.
    pub fn new(instants: Instants<'_>, process: Option<&Process>) -> Self {
        let mut steps = Vec::with_capacity(instants.t_s.len());
        let mut log_determinant = 0.0;
        let power = process.map_or(0.0, |process| process.sigma_deg_h * process.sigma_deg_h);
        let stationary = process.map_or([0.0; 2], |process| stationary(process, power));
        let mut covariance = [[stationary[0], 0.0], [0.0, stationary[1]]];
        let transient = process.filter(|process| process.kernel == Kernel::Transient);
        let (mut last_s, mut last_rest_s) = (None, None);
        for ((&t_s, &rest_s), &variance) in instants.t_s.iter().zip(instants.rests_s).zip(instants.variance) {
            let step_s: f64 = last_s.replace(t_s).map_or(0.0, |last_s: f64| t_s - last_s);
            let comes_to_rest = last_rest_s.replace(rest_s) != Some(rest_s);
            let mut transition = process.map_or([[0.0; 2]; 2], |process| transition(process, step_s));
            if let Some(process) = transient {
                covariance = if comes_to_rest {
                    // Nothing is left of the last one.
                    transition = [[0.0; 2]; 2];
                    [[power * (-2.0 * (t_s - rest_s) / process.time_s).exp(), 0.0], [0.0; 2]]
                } else {
                    sandwich(&transition, &covariance)
                };
            } else if step_s > 0.0 {
                // Stationary: what is lost of the variance comes in as noise.
                let carried = sandwich(&transition, &covariance);
                let kept = sandwich(&transition, &[[stationary[0], 0.0], [0.0, stationary[1]]]);
                covariance = std::array::from_fn(|i| {
                    std::array::from_fn(|j| carried[i][j] - kept[i][j] + if i == j { stationary[i] } else { 0.0 })
                });
            }
            let innovation = covariance[0][0] + variance;
            let gain = [covariance[0][0] / innovation, covariance[1][0] / innovation];
            let first = covariance[0];
            covariance = std::array::from_fn(|i| std::array::from_fn(|j| covariance[i][j] - gain[i] * first[j]));
            log_determinant += innovation.ln();
            steps.push(Step { transition, gain, inverse: 1.0 / innovation.sqrt() });
        }
        Self { steps, log_determinant }
    }

    /// Makes a column independent.
    pub fn apply(&self, column: &mut [f64]) {
        let mut state = [0.0; 2];
        for (value, step) in column.iter_mut().zip(&self.steps) {
            let [[a, b], [c, d]] = step.transition;
            state = [a * state[0] + b * state[1], c * state[0] + d * state[1]];
            let innovation = *value - state[0];
            state[0] += step.gain[0] * innovation;
            state[1] += step.gain[1] * innovation;
            *value = innovation * step.inverse;
        }
    }

    /// The transpose of [`Self::apply`].
    pub fn apply_transposed(&self, column: &mut [f64]) {
        // Backwards: what a row's innovation owes to the states before it.
        let mut adjoint = [0.0; 2];
        for (value, step) in column.iter_mut().zip(&self.steps).rev() {
            let weighed = *value * step.inverse;
            let to_innovation = weighed + step.gain[0] * adjoint[0] + step.gain[1] * adjoint[1];
            *value = to_innovation;
            let predicted = [adjoint[0] - to_innovation, adjoint[1]];
            let [[a, b], [c, d]] = step.transition;
            adjoint = [a * predicted[0] + c * predicted[1], b * predicted[0] + d * predicted[1]];
        }
    }
}

/// Variances of the state when nothing was seen.
fn stationary(process: &Process, power: f64) -> [f64; 2] {
    match process.kernel {
        Kernel::Exponential | Kernel::Transient => [power, 0.0],
        // The state's second part is the slope.
        Kernel::Matern | Kernel::SquaredExponential => [power, 3.0 * power / (process.time_s * process.time_s)],
        Kernel::DampedCosine { .. } => [power, power],
    }
}

fn transition(process: &Process, step_s: f64) -> [[f64; 2]; 2] {
    let tau_s = process.time_s;
    match process.kernel {
        Kernel::Exponential | Kernel::Transient => [[(-step_s / tau_s).exp(), 0.0], [0.0, 0.0]],
        Kernel::Matern | Kernel::SquaredExponential => {
            let rate = 3f64.sqrt() / tau_s;
            let decay = (-rate * step_s).exp();
            [
                [decay * (1.0 + rate * step_s), decay * step_s],
                [-decay * rate * rate * step_s, decay * (1.0 - rate * step_s)],
            ]
        }
        Kernel::DampedCosine { period_s } => {
            let (sin, cos) = (std::f64::consts::TAU * step_s / period_s).sin_cos();
            let decay = (-step_s / tau_s).exp();
            [[decay * cos, decay * sin], [-decay * sin, decay * cos]]
        }
    }
}

fn sandwich(transition: &[[f64; 2]; 2], covariance: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let half: [[f64; 2]; 2] =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..2).map(|k| transition[i][k] * covariance[k][j]).sum()));
    std::array::from_fn(|i| std::array::from_fn(|j| (0..2).map(|k| half[i][k] * transition[j][k]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the covariance matrix itself: for every kernel xᵀ V⁻¹ y by the filter and by solving, and log |V|.
    #[test]
    fn by_the_covariance_itself() {
        let t_s = [0.0_f64, 1.0, 2.0, 5.0, 9.0];
        let variance = [0.3, 0.2, 0.3, 0.1, 0.4];
        let rests_s = [-1.0, -1.0, -1.0, 4.0, 4.0];
        for kernel in [Kernel::Exponential, Kernel::Matern, Kernel::DampedCosine { period_s: 7.0 }, Kernel::Transient] {
            let process = Process { kernel, sigma_deg_h: 0.8, time_s: 4.0 };
            let of_rest = |i: usize, j: usize| match rests_s[i] == rests_s[j] {
                true => (-(t_s[i] + t_s[j] - 2.0 * rests_s[i]) / 4.0).exp(),
                false => 0.0,
            };
            let correlation = |d: f64| match kernel {
                Kernel::Matern => (1.0 + 3f64.sqrt() * d / 4.0) * (-(3f64.sqrt()) * d / 4.0).exp(),
                Kernel::DampedCosine { period_s } => (-d / 4.0).exp() * (std::f64::consts::TAU * d / period_s).cos(),
                _ => (-d / 4.0).exp(),
            };
            let covariance = nalgebra::DMatrix::from_fn(5, 5, |i, j| {
                let between =
                    if kernel == Kernel::Transient { of_rest(i, j) } else { correlation((t_s[i] - t_s[j]).abs()) };
                0.64 * between + if i == j { variance[i] } else { 0.0 }
            });
            let (x, y) = ([1.0, -2.0, 0.5, 3.0, 1.0], [0.3, 1.0, -1.0, 0.0, 2.0]);
            let expected = (nalgebra::RowDVector::from_row_slice(&x)
                * covariance.clone().cholesky().unwrap().solve(&nalgebra::DVector::from_row_slice(&y)))[0];
            let whitener =
                Whitener::new(Instants { t_s: &t_s, rests_s: &rests_s, variance: &variance }, Some(&process));
            let (mut white_x, mut white_y) = (x, y);
            whitener.apply(&mut white_x);
            whitener.apply(&mut white_y);
            let found: f64 = white_x.iter().zip(&white_y).map(|(a, b)| a * b).sum();
            assert!((found - expected).abs() < 1e-9, "{kernel:?}: {found} {expected}");
            assert!((whitener.log_determinant - covariance.determinant().ln()).abs() < 1e-9);
            whitener.apply_transposed(&mut white_y);
            let found: f64 = x.iter().zip(&white_y).map(|(a, b)| a * b).sum();
            assert!((found - expected).abs() < 1e-9, "{kernel:?}: {found} {expected}");
        }
    }
}

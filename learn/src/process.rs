//! A process of every run's own beside white noise, by state space: a Kalman filter makes independent what it makes dependent.

use std::ops::Range;

use north_finder::effects::doubt::{Kernel, Process};

/// Numbers that are computed side by side, as a processor does: of columns that are made independent, of an inner product.
pub const LANES: usize = 8;

/// The rows of one run: their middle, when the index had come to rest before each, s, their variance, (°/h)², and what 1 °/h of a process adds to each, °/h.
#[derive(Clone, Copy)]
pub struct Instants<'a> {
    pub t_s: &'a [f64],
    pub rests_s: &'a [f64],
    pub variance: &'a [f64],
    pub gains: &'a [f64],
}

/// What makes the rows of one run independent, of variance 1: the same linear filter for every column.
pub struct Whitener {
    steps: Vec<Step>,
    /// There is no process.
    is_white: bool,
    /// Logarithm of the determinant of the rows' covariance.
    pub log_determinant: f64,
}

#[derive(Clone, Copy)]
struct Step {
    /// Transition to this row, row by row.
    transition: [[f64; 2]; 2],
    gain: [f64; 2],
    /// What the process adds to the row, by its state's first part.
    seen: f64,
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
        let decaying = process.filter(|process| process.kernel.decays());
        let (mut last_s, mut last_since_s) = (None, None);
        // Most rows are as far from the one before as that from its own: the exponentials are the same.
        let mut known = (f64::NAN, [[0.0; 2]; 2]);
        let rows = instants.t_s.iter().zip(instants.rests_s).zip(instants.variance.iter().zip(instants.gains));
        for ((&t_s, &rest_s), (&variance, &seen)) in rows {
            let step_s: f64 = last_s.replace(t_s).map_or(0.0, |last_s: f64| t_s - last_s);
            // Since when there is something that decays: the run begins with its first rest.
            let since_s = match process.map(|process| process.kernel) {
                Some(Kernel::Start) => *instants.rests_s.first().unwrap_or(&rest_s),
                _ => rest_s,
            };
            let begins = last_since_s.replace(since_s) != Some(since_s);
            if step_s != known.0 {
                known = (step_s, process.map_or([[0.0; 2]; 2], |process| transition(process, step_s)));
            }
            let mut transition = known.1;
            if let Some(process) = decaying {
                covariance = if begins {
                    // Nothing is left of the last one.
                    transition = [[0.0; 2]; 2];
                    [[power * (-2.0 * (t_s - since_s) / process.time_s).exp(), 0.0], [0.0; 2]]
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
            let innovation = seen * seen * covariance[0][0] + variance;
            let gain = [seen * covariance[0][0] / innovation, seen * covariance[1][0] / innovation];
            let first = covariance[0].map(|entry| seen * entry);
            covariance = std::array::from_fn(|i| std::array::from_fn(|j| covariance[i][j] - gain[i] * first[j]));
            log_determinant += innovation.ln();
            steps.push(Step { transition, gain, seen, inverse: 1.0 / innovation.sqrt() });
        }
        Self { steps, is_white: process.is_none(), log_determinant }
    }

    /// Makes a column independent.
    pub fn apply(&self, column: &mut [f64]) {
        self.apply_to_rows(column.as_chunks_mut::<1>().0);
    }

    /// Makes columns of all runs independent in the rows of this run, the first of which is the row `first`: the columns lie one after the other and have
    /// `length` rows each. `lanes` is room to work in; `rounded` makes a number of the columns' own kind.
    pub fn apply_all<T: Copy + Into<f64>>(
        &self,
        columns: &mut [T],
        length: usize,
        first: usize,
        lanes: &mut Vec<f64>,
        rounded: impl Fn(f64) -> T,
    ) {
        let rows = first..first + self.steps.len();
        let length = length.max(1);
        if self.is_white {
            let weigh = |(value, step): (&mut T, &Step)| {
                let own: f64 = (*value).into();
                *value = rounded(own * step.inverse);
            };
            columns.chunks_mut(length).for_each(|all| all[rows.clone()].iter_mut().zip(&self.steps).for_each(weigh));
            return;
        }
        for group in columns.chunks_mut(LANES * length) {
            match group.len() / length {
                1 => self.apply_to_group::<1, T>(group, length, &rows, lanes, &rounded),
                2..=4 => self.apply_to_group::<4, T>(group, length, &rows, lanes, &rounded),
                _ => self.apply_to_group::<LANES, T>(group, length, &rows, lanes, &rounded),
            }
        }
    }

    /// The same of so many columns at most.
    fn apply_to_group<const N: usize, T: Copy + Into<f64>>(
        &self,
        group: &mut [T],
        length: usize,
        rows: &Range<usize>,
        lanes: &mut Vec<f64>,
        rounded: &impl Fn(f64) -> T,
    ) {
        lanes.clear();
        lanes.resize(N * self.steps.len(), 0.0);
        let (lanes, _) = lanes.as_chunks_mut::<N>();
        for (lane, column) in group.chunks(length).enumerate() {
            lanes.iter_mut().zip(&column[rows.clone()]).for_each(|(row, value)| row[lane] = (*value).into());
        }
        self.apply_to_rows(lanes);
        for (lane, column) in group.chunks_mut(length).enumerate() {
            column[rows.clone()].iter_mut().zip(&*lanes).for_each(|(value, row)| *value = rounded(row[lane]));
        }
    }

    /// Makes columns independent whose values stand row by row.
    fn apply_to_rows<const N: usize>(&self, rows: &mut [[f64; N]]) {
        let mut state = [[0.0; N]; 2];
        for (values, step) in rows.iter_mut().zip(&self.steps) {
            let [[a, b], [c, d]] = step.transition;
            for (lane, value) in values.iter_mut().enumerate() {
                let [first, second] = [state[0][lane], state[1][lane]];
                let predicted = [a * first + b * second, c * first + d * second];
                let innovation = *value - step.seen * predicted[0];
                state[0][lane] = predicted[0] + step.gain[0] * innovation;
                state[1][lane] = predicted[1] + step.gain[1] * innovation;
                *value = innovation * step.inverse;
            }
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
            let predicted = [adjoint[0] - step.seen * to_innovation, adjoint[1]];
            let [[a, b], [c, d]] = step.transition;
            adjoint = [a * predicted[0] + c * predicted[1], b * predicted[0] + d * predicted[1]];
        }
    }
}

/// Variances of the state when nothing was seen.
fn stationary(process: &Process, power: f64) -> [f64; 2] {
    match process.kernel {
        Kernel::Exponential | Kernel::Transient | Kernel::Start => [power, 0.0],
        // The state's second part is the slope.
        Kernel::Matern | Kernel::SquaredExponential => [power, 3.0 * power / (process.time_s * process.time_s)],
        Kernel::DampedCosine { .. } => [power, power],
    }
}

fn transition(process: &Process, step_s: f64) -> [[f64; 2]; 2] {
    let tau_s = process.time_s;
    match process.kernel {
        Kernel::Exponential | Kernel::Transient | Kernel::Start => [[(-step_s / tau_s).exp(), 0.0], [0.0, 0.0]],
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
    use north_finder::effects::effect::Port;

    use super::*;

    /// Against the covariance matrix itself: for every kernel xᵀ V⁻¹ y by the filter and by solving, and log |V|.
    #[test]
    fn by_the_covariance_itself() {
        let t_s = [0.0_f64, 1.0, 2.0, 5.0, 9.0];
        let variance = [0.3, 0.2, 0.3, 0.1, 0.4];
        let gains = [1.0, -0.5, 0.7, 1.2, 0.0];
        let rests_s = [-1.0, -1.0, -1.0, 4.0, 4.0];
        for kernel in [
            Kernel::Exponential,
            Kernel::Matern,
            Kernel::DampedCosine { period_s: 7.0 },
            Kernel::Transient,
            Kernel::Start,
        ] {
            let process = Process { port: Port::Rate, kernel, sigma_deg_h: 0.8, time_s: 4.0 };
            let of_rest = |i: usize, j: usize| match rests_s[i] == rests_s[j] {
                true => (-(t_s[i] + t_s[j] - 2.0 * rests_s[i]) / 4.0).exp(),
                false => 0.0,
            };
            let of_start = |i: usize, j: usize| (-(t_s[i] + t_s[j] - 2.0 * rests_s[0]) / 4.0).exp();
            let correlation = |d: f64| match kernel {
                Kernel::Matern => (1.0 + 3f64.sqrt() * d / 4.0) * (-(3f64.sqrt()) * d / 4.0).exp(),
                Kernel::DampedCosine { period_s } => (-d / 4.0).exp() * (std::f64::consts::TAU * d / period_s).cos(),
                _ => (-d / 4.0).exp(),
            };
            let covariance = nalgebra::DMatrix::from_fn(5, 5, |i, j| {
                let between = match kernel {
                    Kernel::Transient => of_rest(i, j),
                    Kernel::Start => of_start(i, j),
                    _ => correlation((t_s[i] - t_s[j]).abs()),
                };
                0.64 * gains[i] * gains[j] * between + if i == j { variance[i] } else { 0.0 }
            });
            let (x, y) = ([1.0, -2.0, 0.5, 3.0, 1.0], [0.3, 1.0, -1.0, 0.0, 2.0]);
            let expected = (nalgebra::RowDVector::from_row_slice(&x)
                * covariance.clone().cholesky().unwrap().solve(&nalgebra::DVector::from_row_slice(&y)))[0];
            let whitener = Whitener::new(
                Instants { t_s: &t_s, rests_s: &rests_s, variance: &variance, gains: &gains },
                Some(&process),
            );
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

    /// Up to twenty columns side by side become what each becomes by itself, to the last bit, in the rows of the run and in no others.
    #[test]
    fn columns_side_by_side_are_made_independent_as_one_by_one() {
        let t_s = [0.0, 1.0, 2.0, 5.0, 9.0];
        let instants = Instants {
            t_s: &t_s,
            rests_s: &[-1.0, -1.0, -1.0, 4.0, 4.0],
            variance: &[0.3, 0.2, 0.3, 0.1, 0.4],
            gains: &[1.0; 5],
        };
        let process = |kernel| Process { port: Port::Rate, kernel, sigma_deg_h: 0.8, time_s: 4.0 };
        for process in [None, Some(process(Kernel::Matern)), Some(process(Kernel::Transient))] {
            let whitener = Whitener::new(instants, process.as_ref());
            let mut lanes = Vec::new();
            for count in [1, 2, 5, 9, 20] {
                let values: Vec<f64> = (0..8 * count).map(|i| (1.3 * i as f64).sin()).collect();
                let mut all = values.clone();
                whitener.apply_all(&mut all, 8, 2, &mut lanes, |value| value);
                let mut expected = values;
                expected.chunks_mut(8).for_each(|column| whitener.apply(&mut column[2..7]));
                assert_eq!(all, expected, "{process:?}, {count} columns");
            }
        }
    }
}

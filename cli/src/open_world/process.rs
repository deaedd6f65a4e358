//! The process of a run's own: kernels that it may have, and their shares in a campaign.

use nalgebra::DMatrix;

/// Sizes of the process in units of the noise of a ten-second mean.
const SIZES: [f64; 5] = [0.2, 0.6, 1.6, 4.5, 14.0];
const TIMES_S: [f64; 5] = [6.0, 20.0, 60.0, 180.0, 500.0];
const PERIODS_S: [f64; 8] = [20.0, 32.0, 50.0, 80.0, 125.0, 200.0, 320.0, 500.0];
const PERIODIC_SIZES: [f64; 3] = [1.0, 3.0, 9.0];
/// Periods over which a damped cosine dies away.
pub const DAMPING: f64 = 6.0;
/// Log-likelihood that processes of the runs' own must gain over white noise to count.
pub const PROCESS: f64 = 10.0;
/// Rounds of the estimation of the shares.
const ROUNDS: usize = 30;

/// Correlation of a stationary process at the time difference d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// exp(−d/τ).
    Exponential,
    /// (1 + √3 d/τ) exp(−√3 d/τ).
    Matern,
    /// exp(−d²/2τ²).
    SquaredExponential,
    /// cos(2πd/τ) exp(−d/6τ).
    DampedCosine,
    /// What happens in the run by itself; over many runs like an exponential one.
    Course,
}

/// A kernel: shape, size relative to the unit, time in seconds. `None` as shape: no process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    pub shape: Option<Shape>,
    pub size: f64,
    pub time_s: f64,
}

/// All kernels that a run may have; the first is none, the last its course. Kernels of the same shape and time stand together.
pub fn kernels() -> Vec<Kernel> {
    let mut all = vec![Kernel { shape: None, size: 0.0, time_s: 1.0 }];
    for shape in [Shape::Exponential, Shape::Matern, Shape::SquaredExponential] {
        for time_s in TIMES_S {
            all.extend(SIZES.map(|size| Kernel { shape: Some(shape), size, time_s }));
        }
    }
    for time_s in PERIODS_S {
        all.extend(PERIODIC_SIZES.map(|size| Kernel { shape: Some(Shape::DampedCosine), size, time_s }));
    }
    all.push(Kernel { shape: Some(Shape::Course), size: 0.0, time_s: 1.0 });
    all
}

impl Shape {
    /// The correlation, integrated twice from 0: the covariance of means over spans is made of its differences.
    fn twice_integrated(self, time_s: f64, apart_s: f64) -> f64 {
        let d = apart_s.abs();
        match self {
            Self::Exponential | Self::Course => time_s * d + time_s * time_s * (-d / time_s).exp(),
            Self::Matern => {
                let s = 3f64.sqrt() / time_s;
                2.0 * d / s + (-s * d).exp() * (3.0 / (s * s) + d / s)
            }
            Self::SquaredExponential => {
                let x = d / (std::f64::consts::SQRT_2 * time_s);
                let root = (0.5 * std::f64::consts::PI).sqrt();
                time_s * (root * d * libm::erf(x) + time_s * (-x * x).exp())
            }
            Self::DampedCosine => {
                // The real part of d/z + exp(−zd)/z² with z = 1/(6τ) + 2πi/τ.
                let (a, b) = (1.0 / (DAMPING * time_s), std::f64::consts::TAU / time_s);
                let squared = a * a + b * b;
                let (sin, cos) = (b * d).sin_cos();
                let (real, imaginary) = ((a * a - b * b) / squared.powi(2), -2.0 * a * b / squared.powi(2));
                d * a / squared + (-a * d).exp() * (real * cos + imaginary * sin)
            }
        }
    }

    /// Covariance of means over spans of a process with a variance of 1.
    pub fn covariance(self, time_s: f64, spans: &[[f64; 2]]) -> DMatrix<f64> {
        let n = spans.len();
        let mut matrix = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let ([a, b], [c, d]) = (spans[i], spans[j]);
                let of = |apart| self.twice_integrated(time_s, apart);
                let value = (of(b - c) - of(b - d) - of(a - c) + of(a - d)) / ((b - a) * (d - c));
                matrix[(i, j)] = value;
                matrix[(j, i)] = value;
            }
        }
        matrix
    }
}

/// Shares of the kernels in a campaign, from the log-likelihood of every run under every kernel: empirical Bayes by
/// expectation and maximisation, with a little of every kernel.
pub fn shares(log_likelihood: &[Vec<f64>]) -> Vec<f64> {
    let kernels = log_likelihood.first().map_or(1, Vec::len);
    let mut shares = vec![0.7 / kernels as f64; kernels];
    shares[0] = 0.3;
    let little = 0.5 / kernels as f64;
    for _ in 0..ROUNDS {
        let mut sum = vec![little; kernels];
        for run in log_likelihood {
            posterior(run, &shares).iter().zip(&mut sum).for_each(|(weight, sum)| *sum += weight);
        }
        let total: f64 = sum.iter().sum();
        shares = sum.into_iter().map(|each| each / total).collect();
    }
    shares
}

/// Log-likelihood of one run under the mixture of kernels.
pub fn mixture(log_likelihood: &[f64], shares: &[f64]) -> f64 {
    let most = log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = log_likelihood.iter().zip(shares).map(|(value, share)| share * (value - most).exp()).sum();
    most + sum.ln()
}

/// Probability of every kernel for one run.
pub fn posterior(log_likelihood: &[f64], shares: &[f64]) -> Vec<f64> {
    let joint: Vec<f64> = log_likelihood.iter().zip(shares).map(|(value, share)| value + share.ln()).collect();
    let most = joint.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = joint.iter().map(|value| (value - most).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / total).collect()
}

//! Weighted least squares of h cos ψ, h sin ψ, bias and drift, and what is made of the drift.

use nalgebra::{Matrix4, Vector4};

use super::Unsolvable;
use super::observation::{Observation, regular_inverse};
use super::problem::Problem;
use crate::units::{DEG_PER_RAD, wrap_180_deg, wrap_360_deg};

/// Unknowns of a fix with a free drift.
const PARAMETERS: usize = 4;
/// At a drift this many sigmas from nothing (declared and estimated together, and as much more as the dwells scatter beside it) a drift as it was declared
/// and a free one are equally probable.
const DRIFT_SIGMAS: f64 = 3.0;
/// So many sigmas below, the drift is as it was declared; so many above, it is free; between, the estimate is the mean of both.
const DRIFT_UNDECIDED_SIGMAS: f64 = 1.0;
/// A drift that is declared as none is still allowed this much, °/h per hour, to keep the equations regular.
pub(super) const LEAST_DRIFT: f64 = 1e-6;
/// Relative amplitude error that is not held against a fix: scale factor and latitude of an honest instrument.
pub(super) const AMPLITUDE_TOLERANCE: f64 = 0.01;
/// A least-squares estimate of h cos ψ, h sin ψ, bias and drift.
pub(super) struct Estimate {
    pub parameters: Vector4<f64>,
    /// Inverse of the normal matrix; times the variance of a one-second rate, the covariance.
    pub inverse: Matrix4<f64>,
    /// Weighted residual sum of squares.
    pub residual: f64,
    /// Observations of some weight.
    pub count: usize,
}

impl Estimate {
    /// With `drift_weight` = s²/σ² of the declared drift about zero; 0 estimates the drift freely.
    pub fn new(problem: &Problem<'_>, drift_weight: f64) -> Option<Self> {
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        problem.for_each(&mut |observation| observation.add_to(&mut normal, &mut right));
        normal.m44 += drift_weight;
        let inverse = regular_inverse(&normal)?;
        let parameters = inverse * right;
        let (mut squares, mut count) = (drift_weight * parameters.w * parameters.w, 0);
        let mut judge = |Observation { weight, row, rate_deg_h, .. }: Observation| {
            let residual = rate_deg_h - row.dot(&parameters);
            squares += weight * residual * residual;
            count += usize::from(weight > 0.0);
        };
        problem.for_each(&mut judge);
        Some(Self { parameters, inverse, residual: squares, count })
    }

    /// The mean of this one and another of the same rates that has this probability.
    fn mean_with(&self, other: &Self, probability: f64) -> Self {
        Self {
            parameters: self.parameters + (other.parameters - self.parameters) * probability,
            inverse: self.inverse + (other.inverse - self.inverse) * probability,
            residual: self.residual + (other.residual - self.residual) * probability,
            count: self.count,
        }
    }

    pub fn azimuth_deg(&self) -> f64 {
        wrap_360_deg(libm::atan2(self.parameters.y, self.parameters.x) * DEG_PER_RAD)
    }

    /// Direction derivative of the azimuth: dψ/d(h cos ψ, h sin ψ, …), rad per °/h.
    pub fn gradient(&self) -> Vector4<f64> {
        let &[x, y, _, _] = self.parameters.as_ref();
        let squared = x * x + y * y;
        Vector4::new(-y / squared, x / squared, 0.0, 0.0)
    }
}

/// How the drift was dealt with.
pub(super) struct Drift {
    pub estimate: Estimate,
    /// It is rather free than as it was declared.
    pub free: bool,
    /// What an undecided drift could do to the azimuth, one sigma, degrees.
    pub doubt_deg: f64,
}

/// With the drift held to its declaration if the data allow it, else free; undecided, the mean of both by their probabilities.
pub(super) fn settle_drift(problem: &Problem<'_>, variance: f64, drift_sigma: f64) -> Result<Drift, Unsolvable> {
    let declared =
        Estimate::new(problem, variance / (drift_sigma * drift_sigma)).ok_or(Unsolvable::TooFewDirections)?;
    // A drift that takes the last redundancy would explain whatever is wrong.
    let Some(free) = Estimate::new(problem, 0.0).filter(|free| free.count > PARAMETERS) else {
        return Ok(Drift { estimate: declared, free: false, doubt_deg: 0.0 });
    };
    // Where the dwells contradict each other beside the drift as well, something else than a drift is in them.
    let misfit = (free.residual / (variance * (free.count - PARAMETERS) as f64)).max(1.0);
    let spread = drift_sigma * drift_sigma + variance * misfit * free.inverse.m44;
    let sigmas = libm::sqrt(free.parameters.w * free.parameters.w / spread);
    // Dwells without noise and a drift declared as none give no number of sigmas; the drift is then held as declared.
    if sigmas.is_nan() || sigmas < DRIFT_SIGMAS - DRIFT_UNDECIDED_SIGMAS {
        return Ok(Drift { estimate: declared, free: false, doubt_deg: 0.0 });
    }
    if sigmas > DRIFT_SIGMAS + DRIFT_UNDECIDED_SIGMAS {
        return Ok(Drift { estimate: free, free: true, doubt_deg: 0.0 });
    }
    // The likelihood of normal errors goes with e^(sigmas²/2).
    let probability = 1.0 / (1.0 + libm::exp((DRIFT_SIGMAS * DRIFT_SIGMAS - sigmas * sigmas) / 2.0));
    let apart_deg = wrap_180_deg(free.azimuth_deg() - declared.azimuth_deg()).abs();
    Ok(Drift {
        estimate: declared.mean_with(&free, probability),
        free: probability > 0.5,
        doubt_deg: libm::sqrt(probability * (1.0 - probability)) * apart_deg,
    })
}

/// Where there are too few rows in a dwell to tell the noise (a continuous rotation): variance of a one-second rate,
/// (°/h)², from the differences of successive residuals.
pub(super) fn variance_of_successive_residuals(problem: &Problem<'_>) -> Option<f64> {
    let parameters = Estimate::new(problem, LEAST_DRIFT)?.parameters;
    let (mut last, mut sum, mut pairs) = (None, 0.0, 0.0);
    for dwell in problem.dwells {
        let Observation { weight, row, rate_deg_h, .. } = problem.mean(dwell);
        if weight > 0.0 {
            let (residual, share) = (rate_deg_h - row.dot(&parameters), 1.0 / weight);
            if let Some((before, share_before)) = last.replace((residual, share)) {
                let difference: f64 = residual - before;
                sum += difference * difference / (share + share_before);
                pairs += 1.0;
            }
        }
    }
    (pairs > 0.0).then(|| sum / pairs)
}

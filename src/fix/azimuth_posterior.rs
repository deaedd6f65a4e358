//! The azimuth where effects of the model depend on it: its probability over all azimuths that may be, in place of a slope about one of them.
//!
//! At a supposed azimuth the effects are what they are there, and the rates are linear in what is left: the amplitude, which is the Earth's but for
//! what scale factor and latitude of a sound instrument are wrong by, bias and drift. With these integrated out the probability of the rates
//! is exp(−r²/2s²)/√det N: r² the weighted residuals, s² the variance of a one-second rate, N the normal matrix of what is left. A gyro that
//! does not answer small rates (lock-in, a dead zone) reads alike over a range of azimuths: no slope tells how wide it is.

use nalgebra::{Matrix3, Vector3};

use super::azimuth_effects::AzimuthEffects;
use super::estimate::AMPLITUDE_TOLERANCE;
use super::problem::Problem;
use crate::effects::ErrorModel;
use crate::units::{sin_cos_deg, wrap_360_deg};

/// Azimuths that are supposed beside each other, on both sides of the middle one.
const STEPS: i32 = 20;
/// At first so many sigmas of the estimate on both sides, and at least this, degrees.
const FIRST_SIGMAS: f64 = 6.0;
const LEAST_HALF_WIDTH_DEG: f64 = 0.03;
/// What is less probable than the best by more than this does not count, nats: e^-12.5 is the density at five sigmas.
const NEGLIGIBLE: f64 = 12.5;
/// The range is changed by this factor, and so often at most: from the least to all azimuths.
const WIDER: f64 = 4.0;
const MOST_CHANGES: usize = 8;
/// The steps are narrow enough where this many of them count.
const LEAST_COUNTING: usize = 6;

/// Mean and standard deviation of the azimuth.
pub(super) struct Posterior {
    pub azimuth_deg: f64,
    pub sigma_deg: f64,
}

/// Supposes azimuths about one that was estimated with a sigma, both in degrees. `variance`: of a one-second rate, (°/h)²; `drift_weight`: the
/// same by the square of the declared drift. `None` where the rates determine none.
#[inline(never)]
pub(super) fn posterior<'a>(
    problem: &mut Problem<'a>,
    model: &'a ErrorModel,
    (azimuth_deg, sigma_deg): (f64, f64),
    variance: f64,
    drift_weight: f64,
) -> Option<Posterior> {
    let settled = problem.at_azimuth;
    let (mut middle_deg, mut half_width_deg) = (azimuth_deg, f64::max(FIRST_SIGMAS * sigma_deg, LEAST_HALF_WIDTH_DEG));
    let mut found = None;
    for _ in 0..MOST_CHANGES {
        half_width_deg = half_width_deg.min(180.0);
        let step_deg = half_width_deg / f64::from(STEPS);
        let (mut scan, mut last) = (Scan::default(), 0.0);
        for number in -STEPS..=STEPS {
            let supposed_deg = middle_deg + f64::from(number) * step_deg;
            problem.at_azimuth =
                Some(AzimuthEffects::new(model, problem.dwells, problem.earth, supposed_deg).without_slope());
            last = log_probability(problem, supposed_deg, variance, drift_weight)?;
            scan.push(f64::from(number) * step_deg, last);
        }
        found = scan.moments().map(|(mean_deg, sigma_deg)| Posterior {
            azimuth_deg: wrap_360_deg(middle_deg + mean_deg),
            // Inside a step nothing is told.
            sigma_deg: libm::hypot(sigma_deg, step_deg / libm::sqrt(12.0)),
        });
        let ends = f64::max(scan.first, last);
        if ends > scan.best - NEGLIGIBLE && half_width_deg < 180.0 {
            half_width_deg *= WIDER;
        } else if scan.counting < LEAST_COUNTING {
            (middle_deg, half_width_deg) = (middle_deg + scan.best_deg, half_width_deg / WIDER);
        } else {
            break;
        }
    }
    problem.at_azimuth = settled;
    found
}

/// Logarithm of the probability of the rates at a supposed azimuth, but for what is the same at all.
fn log_probability(problem: &Problem<'_>, supposed_deg: f64, variance: f64, drift_weight: f64) -> Option<f64> {
    let (sin, cos) = sin_cos_deg(supposed_deg);
    let north_deg_h = problem.earth.north_deg_h;
    // Unknowns: relative error of the amplitude, bias, drift.
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    let mut squares = 0.0;
    problem.for_each(&mut |observation| {
        let earth_deg_h = north_deg_h * (observation.row.x * cos + observation.row.y * sin);
        let row = Vector3::new(earth_deg_h, observation.row.z, observation.row.w);
        let residual = observation.rate_deg_h - earth_deg_h;
        normal += observation.weight * row * row.transpose();
        right += observation.weight * residual * row;
        squares += observation.weight * residual * residual;
    });
    normal.m11 += variance / (AMPLITUDE_TOLERANCE * AMPLITUDE_TOLERANCE);
    normal.m33 += drift_weight;
    let factor = normal.cholesky()?;
    let residual = squares - right.dot(&factor.solve(&right));
    let half_log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|pivot| libm::log(*pivot)).sum();
    Some(-0.5 * residual / variance - half_log_determinant)
}

/// Probabilities at even steps, in units of the best's so far.
struct Scan {
    best: f64,
    best_deg: f64,
    first: f64,
    /// Steps that are not negligible.
    counting: usize,
    sums: [f64; 3],
}

impl Default for Scan {
    fn default() -> Self {
        Self { best: f64::NEG_INFINITY, best_deg: 0.0, first: f64::NEG_INFINITY, counting: 0, sums: [0.0; 3] }
    }
}

impl Scan {
    fn push(&mut self, offset_deg: f64, log: f64) {
        if self.first == f64::NEG_INFINITY {
            self.first = log;
        }
        if log > self.best {
            let less = libm::exp(self.best - log);
            self.sums.iter_mut().for_each(|sum| *sum *= less);
            self.counting = if log - self.best > NEGLIGIBLE { 0 } else { self.counting };
            (self.best, self.best_deg) = (log, offset_deg);
        }
        self.counting += usize::from(log > self.best - NEGLIGIBLE);
        let share = libm::exp(log - self.best);
        for (sum, power) in self.sums.iter_mut().zip([1.0, offset_deg, offset_deg * offset_deg]) {
            *sum += share * power;
        }
    }

    /// Mean and standard deviation, degrees.
    fn moments(&self) -> Option<(f64, f64)> {
        let [whole, first, second] = self.sums;
        let mean_deg = first / whole;
        let variance = second / whole - mean_deg * mean_deg;
        mean_deg.is_finite().then(|| (mean_deg, libm::sqrt(variance.max(0.0))))
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use crate::effects::carried::MAX_GATES;
    use crate::effects::effect::Port;
    use crate::effects::factor::Factor;
    use crate::effects::shape::Broken;
    use crate::effects::signal::Rate;
    use crate::effects::{Effect, ErrorModel};
    use crate::fix::dwell::DwellSummary;
    use crate::fix::tests::{declared, dwell};
    use crate::fix::{Fix, solve};
    use crate::units::wrap_180_deg;

    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;
    const DEAD_DEG_H: f64 = 1.0;

    /// A gyro that does not answer the first 1 °/h of either sign, and a model that says so (but for 1 °/h everywhere, which is a bias).
    fn fix_at(azimuth_deg: f64) -> Fix {
        let dead = Broken { first: -DEAD_DEG_H as f32, second: DEAD_DEG_H as f32, scale: 1.0 };
        let effect = Effect::new(Port::Rate, &[Factor::new(Rate.into(), &[], dead.into())]);
        let mut model = ErrorModel::default();
        model.effects.push(Effect { weights: [0.0, -1.0, 0.0].into_iter().collect(), ..effect }).unwrap();
        let of_position = |(i, index_deg): (i32, f64)| {
            let rate_deg_h = NORTH_DEG_H * libm::cos((azimuth_deg - index_deg).to_radians());
            let answered_deg_h = rate_deg_h - rate_deg_h.clamp(-DEAD_DEG_H, DEAD_DEG_H);
            let mut each = dwell(65.0 * f64::from(i), index_deg, answered_deg_h);
            (0..MAX_GATES).for_each(|gate| each.carried.set_gate(gate, 1.0));
            each
        };
        let dwells: Vec<DwellSummary> = (0..).zip([0.0, 90.0, 180.0, 270.0]).map(of_position).collect();
        solve(&dwells, &declared(60.0), &model).unwrap()
    }

    /// At an azimuth of 0° the axis reads nothing to the east and to the west, and so it does up to asin(1/7.52) = 7.64° on either side. Even
    /// probability over that has a standard deviation of 7.64°/√3 = 4.41°; the amplitude, known to 1 %, makes the ends (1/cos 7.64° − 1 =
    /// 0.9 %) less probable by e^−0.4, and beyond them the noise rounds it off by a few hundredths of a degree.
    #[test]
    fn what_a_gyro_does_not_answer_stands_in_sigma() {
        let fix = fix_at(0.0);
        assert!((3.8..4.45).contains(&fix.sigma_deg), "{}", fix.sigma_deg);
        assert!(wrap_180_deg(fix.azimuth_deg).abs() < 0.1, "{}", fix.azimuth_deg);
    }

    /// At 40° every position answers, and the model takes out what is missing: sigma is that of the noise.
    #[test]
    fn where_it_answers_the_azimuth_is_known() {
        let fix = fix_at(40.0);
        assert!(
            wrap_180_deg(fix.azimuth_deg - 40.0).abs() < 1e-3 && fix.sigma_deg < 0.3,
            "{} {}",
            fix.azimuth_deg,
            fix.sigma_deg
        );
    }
}

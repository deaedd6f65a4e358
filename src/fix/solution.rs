//! From dwells to a fix: noise, drift, misfit, sigma and flags.

use heapless::Vec;
use nalgebra::{Matrix4, SMatrix, Vector4};

use super::azimuth_effects::AzimuthEffects;
use super::azimuth_posterior::{self, Posterior};
use super::base_motion::levels::Path;
use super::base_motion::{BaseMotion, Method};
use super::cause::Cause;
use super::closure::Closure;
use super::doubt::{self, Correlated, MOST};
use super::dwell::DwellSummary;
use super::estimate::{AMPLITUDE_TOLERANCE, Estimate, LEAST_DRIFT, settle_drift, variance_of_successive_residuals};
use super::noise::Noise;
use super::problem::Problem;
use super::sinusoid::Fitted;
use super::statistics::chi_square_z_score;
use super::{Declared, Fix, Unsolvable};
use crate::bounded::bounded;
use crate::earth::EarthRate;
use crate::effects::ErrorModel;
use crate::health::{Flag, Flags};
use crate::sensing::level::{Specific, Tilt};
use crate::units::{DEG_PER_RAD, sin_cos_deg, wrap_180_deg};

/// The horizontal rate is a signal above so many of its standard deviations. Five: noise alone passes it in four of 10⁶ fixes (e^(−25/2)).
const SIGNAL_SIGMAS: f64 = 5.0;
/// The same where a part of sigma is what is not certain of the model: that is no noise in which a signal could be missing, and the azimuth is given
/// with its sigma up to 1/2 rad.
const SIGNAL_SIGMAS_IN_DOUBT: f64 = 2.0;
/// A chi-square this many standard deviations above its mean is a misfit.
const MISFIT_SIGMAS: f64 = 3.0;
/// From this many on, sigma grows with the misfit. Lower than the flag's, so that a sigma is rather too large.
const INFLATION_SIGMAS: f64 = 2.0;
/// Beyond this scale factor error and this error of the latitude an amplitude is not the Earth's.
const SCALE_LIMIT: f64 = 0.1;
const LATITUDE_LIMIT_DEG: f64 = 10.0;
/// Most azimuths that are supposed one after the other, and how nearly two in a row agree, degrees: a hundredth of the best sigma there is.
const AZIMUTH_STEPS: usize = 8;
const AZIMUTH_AGREES_DEG: f64 = 1e-4;
/// Scatter above this multiple of the declared noise is flagged.
const NOISY_RATIO: f64 = 3.0;

/// A fix, and how probable what was supposed for it makes the gyro's rates.
pub(super) struct Solved {
    pub fix: Fix,
    /// Logarithm of the likelihood of the rates, but for what does not depend on what was supposed; 0 where dwells were not weighed together.
    pub log_likelihood: f64,
}

/// The solution for what is supposed to have moved the base and the index.
pub(super) fn solve_for(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
    cause: Cause,
) -> Result<Fix, Unsolvable> {
    solved_for(dwells, declared, model, motion, cause).map(|solved| solved.fix)
}

/// The same, with its likelihood.
pub(super) fn solved_for(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
    cause: Cause,
) -> Result<Solved, Unsolvable> {
    let earth = declared.earth;
    let mut problem = Problem::new(dwells, earth, motion, cause).ok_or(Unsolvable::TooFewDirections)?;
    let mut flags = Flags::default();

    let noise = weigh_noise(&mut problem, declared, model, &mut flags)?;
    let variance = noise.variance;
    let drift_sigma = declared.gyro.drift_deg_h_per_h.max(LEAST_DRIFT);
    fit_sinusoid(&mut problem, model, variance, drift_sigma)?;
    let posterior = settle_azimuth(&mut problem, model, variance, drift_sigma)?;
    weigh_doubt(&mut problem, model, variance);
    let drift = settle_drift(&problem, variance, drift_sigma)?;
    let estimate = &drift.estimate;
    if drift.free {
        flags.insert(Flag::Drift);
    }
    // What a process of the model makes alike is accounted for.
    let widening = if model.doubt.process.is_some() { 1.0 } else { noise.widening };
    if widening > 1.0 {
        flags.insert(Flag::Autocorrelated);
    }

    let chi_square = estimate.residual / variance;
    let determined = if drift.free { 4 } else { 3 };
    let degrees_of_freedom = estimate.count.saturating_sub(determined) as u16;
    let inflation = inflation(chi_square, degrees_of_freedom, &mut flags);

    let &[cos_part, sin_part, bias_deg_h, drift_deg_h_per_h] = estimate.parameters.as_ref();
    let correlated = correlated_covariance(&problem, estimate, declared, model);
    let inverse = problem.sinusoid.map_or(estimate.inverse, |sinusoid| estimate.inverse + sinusoid.doubt);
    let covariance = inverse * (variance * inflation.max(widening)) + correlated;
    judge_parameters(&estimate.parameters, &covariance, declared, model, &mut flags)?;
    judge_dwells(&problem, dwells, &mut flags);
    let tilt = mean_tilt(dwells);
    if tilt.is_none() {
        flags.insert(Flag::TiltUnknown);
    }

    let (apparent_deg, of_rates_deg) = match posterior {
        None => (estimate.azimuth_deg(), turned_by_deg(estimate, &covariance)),
        Some(Posterior { azimuth_deg, sigma_deg }) => {
            let of_noise_deg = sigma_deg * libm::sqrt(inflation.max(widening));
            (azimuth_deg, libm::hypot(of_noise_deg, turned_by_deg(estimate, &correlated)))
        }
    };
    // The azimuth error is the weighted mean of the index errors; over the positions of a fix the root sum of squares of
    // the weights lies between 1/2 and 1/√2. A level error τ about the north line turns the azimuth by τ tan φ.
    let of_index_deg = declared.index_sigma_deg * core::f64::consts::FRAC_1_SQRT_2;
    let of_level_deg = declared.level_sigma_deg * earth.up_deg_h / earth.north_deg_h;
    let closure = Closure::new(&problem, estimate, variance * widening, declared);
    let azimuth_deg = model.true_azimuth_deg(apparent_deg, &earth);
    let log_likelihood = log_likelihood(&problem, estimate, variance * widening, &earth);
    let fix = Fix {
        azimuth_deg,
        sigma_deg: libm::sqrt(
            [of_rates_deg, of_index_deg, of_level_deg, drift.doubt_deg, model.doubt.azimuth_sigma_deg]
                .iter()
                .map(|part| part * part)
                .sum(),
        ),
        closure_deg_h: closure.as_ref().map(|closure| closure.deg_h),
        closure_sigma_deg_h: closure.map(|closure| closure.sigma_deg_h),
        chi_square,
        degrees_of_freedom,
        bias_deg_h,
        amplitude_deg_h: libm::hypot(cos_part, sin_part),
        drift_deg_h_per_h,
        tilt,
        seconds: problem.counting().map(|dwell| dwell.seconds).sum(),
        flags,
    };
    Ok(Solved { fix, log_likelihood })
}

/// Weighs the dwells by their noise.
fn weigh_noise(
    problem: &mut Problem<'_>,
    declared: &Declared,
    model: &ErrorModel,
    flags: &mut Flags,
) -> Result<Noise, Unsolvable> {
    let noise_deg_h = declared.gyro.noise_deg_h();
    let of_residuals = || variance_of_successive_residuals(problem);
    let noise =
        Noise::with(model, problem.counting(), &declared.gyro, of_residuals).ok_or(Unsolvable::TooFewDirections)?;
    problem.noise = Some(noise);
    if noise.white > NOISY_RATIO * NOISY_RATIO * noise_deg_h * noise_deg_h && noise_deg_h > 0.0 {
        flags.insert(Flag::Noisy);
    }
    Ok(noise)
}

/// Takes the sinusoid of the model, if it has one, from the dwells.
fn fit_sinusoid(
    problem: &mut Problem<'_>,
    model: &ErrorModel,
    variance: f64,
    drift_sigma: f64,
) -> Result<(), Unsolvable> {
    let Some(sinusoid) = model.sinusoid else { return Ok(()) };
    let drift_weight = variance / (drift_sigma * drift_sigma);
    let observations = |dwell: &DwellSummary| problem.observations(dwell);
    let fitted = Fitted::new(sinusoid, problem.dwells, &observations, variance, drift_weight);
    problem.sinusoid = Some(fitted.ok_or(Unsolvable::TooFewDirections)?);
    Ok(())
}

/// Whether the base moved, and whether seconds of the dwells were left out.
fn judge_dwells(problem: &Problem<'_>, dwells: &[DwellSummary], flags: &mut Flags) {
    let moves = matches!(problem.motion, BaseMotion::Moving(_)) && !problem.path().is_some_and(Path::stands);
    if moves || dwells.iter().any(|dwell| dwell.base_taken_out) {
        flags.insert(Flag::BaseMotion);
    }
    if problem.counting().any(|dwell| dwell.outliers > 0) {
        flags.insert(Flag::Shock);
    }
}

/// What parameters of this covariance turn the azimuth by, one sigma, degrees.
fn turned_by_deg(estimate: &Estimate, covariance: &Matrix4<f64>) -> f64 {
    let gradient = estimate.gradient();
    libm::sqrt(gradient.dot(&(covariance * gradient))) * DEG_PER_RAD
}

/// Logarithm of the likelihood of the rates, of what was weighed together: of their residuals, of the determinants of their covariance and of
/// the estimate's, and of the amplitude, which is the Earth's but for the error of scale factor and latitude that an honest instrument has.
fn log_likelihood(problem: &Problem<'_>, estimate: &Estimate, variance: f64, earth: &EarthRate) -> f64 {
    let (Some(correlated), Some(of_estimate)) = (&problem.correlated, estimate.inverse.cholesky()) else { return 0.0 };
    let half_log_determinant: f64 = of_estimate.l_dirty().diagonal().iter().map(|pivot| libm::log(*pivot)).sum();
    let &[x, y, _, _] = estimate.parameters.as_ref();
    let amplitude_deg_h = libm::hypot(x, y);
    let along = Vector4::new(x, y, 0.0, 0.0) / amplitude_deg_h;
    let tolerance_deg_h = AMPLITUDE_TOLERANCE * earth.north_deg_h;
    let of_amplitude = variance * along.dot(&(estimate.inverse * along)) + tolerance_deg_h * tolerance_deg_h;
    let off_deg_h = amplitude_deg_h - earth.north_deg_h;
    let logarithms = correlated.log_determinant() - 2.0 * half_log_determinant + libm::log(of_amplitude);
    -0.5 * (estimate.residual / variance + off_deg_h * off_deg_h / of_amplitude + logarithms)
}

/// How much sigma grows by a misfit, as a factor of the variance.
fn inflation(chi_square: f64, degrees_of_freedom: u16, flags: &mut Flags) -> f64 {
    if degrees_of_freedom == 0 {
        flags.insert(Flag::NoRedundancy);
        return 1.0;
    }
    let z_score = chi_square_z_score(chi_square, degrees_of_freedom.into());
    if z_score > MISFIT_SIGMAS {
        flags.insert(Flag::Misfit);
    }
    if z_score > INFLATION_SIGMAS { chi_square / f64::from(degrees_of_freedom) } else { 1.0 }
}

/// Whether the horizontal rate and the bias are what they may be; an azimuth comes only from a rate that can be the Earth's.
fn judge_parameters(
    parameters: &Vector4<f64>,
    covariance: &Matrix4<f64>,
    declared: &Declared,
    model: &ErrorModel,
    flags: &mut Flags,
) -> Result<(), Unsolvable> {
    let earth = &declared.earth;
    let amplitude_deg_h = libm::hypot(parameters.x, parameters.y);
    let along = Vector4::new(parameters.x, parameters.y, 0.0, 0.0) / amplitude_deg_h;
    let amplitude_sigma = libm::sqrt(along.dot(&(covariance * along)));
    let sigmas = if doubt::is_any(&model.doubt) { SIGNAL_SIGMAS_IN_DOUBT } else { SIGNAL_SIGMAS };
    let significant = amplitude_deg_h > sigmas * amplitude_sigma;
    if !significant {
        return Err(Unsolvable::NoSignal);
    }
    let [least_deg_h, most_deg_h] = plausible_amplitude_deg_h(earth);
    if !(least_deg_h - 4.0 * amplitude_sigma..=most_deg_h + 4.0 * amplitude_sigma).contains(&amplitude_deg_h) {
        return Err(Unsolvable::NotEarthRate);
    }
    if parameters.z.abs() > declared.gyro.bias_limit_deg_h + 4.0 * libm::sqrt(covariance.m33) {
        flags.insert(Flag::Bias);
    }
    // The tolerance is four sigmas of an honest instrument's scale factor and latitude, and independent of the noise.
    let beyond_deg_h = libm::hypot(4.0 * amplitude_sigma, AMPLITUDE_TOLERANCE * earth.north_deg_h);
    if (amplitude_deg_h - earth.north_deg_h).abs() > beyond_deg_h {
        flags.insert(Flag::Amplitude);
    }
    Ok(())
}

/// Weighs the dwells by what is not certain of the model.
fn weigh_doubt(problem: &mut Problem<'_>, model: &ErrorModel, variance: f64) {
    Correlated::begin(&mut problem.correlated, &model.doubt, problem.motion.path(), problem.dwells);
    if problem.correlated.is_some() {
        fill_doubt(problem, model, variance);
    }
}

/// Never inlined: what it observes is on no stack but its own.
#[inline(never)]
fn fill_doubt(problem: &mut Problem<'_>, model: &ErrorModel, variance: f64) {
    let observed: Vec<_, MOST> = bounded(problem.dwells.iter().map(|dwell| problem.with_doubts(dwell)));
    let path = problem.motion.path();
    let begun = problem.correlated.as_mut();
    if begun.and_then(|begun| begun.fill(&model.doubt, path, problem.dwells, &observed, variance)).is_none() {
        problem.correlated = None;
    }
}

/// Where the model depends on the azimuth, supposes one, and the next by that, until they agree. Where effects follow it, the azimuth is what is
/// probable of all about there, and the effects are left as they are at it. Never inlined: what it needs would stand on the stack of every fix.
#[inline(never)]
fn settle_azimuth<'a>(
    problem: &mut Problem<'a>,
    model: &'a ErrorModel,
    variance: f64,
    drift_sigma: f64,
) -> Result<Option<Posterior>, Unsolvable> {
    if !model.needs_azimuth() {
        return Ok(None);
    }
    let drift_weight = variance / (drift_sigma * drift_sigma);
    let estimated = |problem: &Problem<'_>| {
        let estimate = Estimate::new(problem, drift_weight).ok_or(Unsolvable::TooFewDirections)?;
        let gradient = estimate.gradient();
        let sigma_deg = libm::sqrt(variance * gradient.dot(&(estimate.inverse * gradient))) * DEG_PER_RAD;
        Ok((estimate.azimuth_deg(), sigma_deg))
    };
    let first = estimated(problem)?;
    let (mut supposed, mut agreed) = (first, false);
    for _ in 0..AZIMUTH_STEPS {
        problem.at_azimuth = Some(AzimuthEffects::new(model, problem.dwells, problem.earth, supposed.0));
        weigh_doubt(problem, model, variance);
        let next = estimated(problem)?;
        agreed = wrap_180_deg(next.0 - supposed.0).abs() < AZIMUTH_AGREES_DEG;
        supposed = next;
        if agreed {
            break;
        }
    }
    problem.at_azimuth = Some(AzimuthEffects::new(model, problem.dwells, problem.earth, supposed.0));
    if model.effects_of_azimuth().next().is_none() {
        return Ok(None);
    }
    let about = if agreed { supposed } else { first };
    let posterior =
        azimuth_posterior::posterior(problem, model, about, variance, drift_weight).ok_or(Unsolvable::NoSignal)?;
    problem.at_azimuth =
        Some(AzimuthEffects::new(model, problem.dwells, problem.earth, posterior.azimuth_deg).without_slope());
    Ok(Some(posterior))
}

/// The horizontal Earth rate, least and most, that a scale factor error and an error of the latitude can make of it.
fn plausible_amplitude_deg_h(earth: &EarthRate) -> [f64; 2] {
    let (sin, cos) = sin_cos_deg(LATITUDE_LIMIT_DEG);
    let up_deg_h = earth.up_deg_h.abs();
    let farther = earth.north_deg_h * cos - up_deg_h * sin;
    // Within the limit of the equator the latitude may be that of the equator.
    let beyond_equator = up_deg_h * cos < earth.north_deg_h * sin;
    let nearer = if beyond_equator {
        libm::hypot(earth.north_deg_h, up_deg_h)
    } else {
        earth.north_deg_h * cos + up_deg_h * sin
    };
    [farther.max(0.0) * (1.0 - SCALE_LIMIT), nearer * (1.0 + SCALE_LIMIT)]
}

/// Covariance of the parameters from errors that do not average out inside a dwell: the declared bias instability, the
/// noise of the base motion that was taken out, and the model's doubt where the weights leave it out.
fn correlated_covariance(
    problem: &Problem<'_>,
    estimate: &Estimate,
    declared: &Declared,
    model: &ErrorModel,
) -> Matrix4<f64> {
    let mut shared = match &problem.correlated {
        None if doubt::is_any(&model.doubt) => {
            doubt::of_right_hand_side(&model.doubt, problem.dwells, &|dwell| problem.with_doubts(dwell))
        }
        _ => Matrix4::zeros(),
    };
    add_of_dwells(&mut shared, problem, declared.gyro.bias_instability_deg_h);
    estimate.inverse * shared * estimate.inverse
}

/// Adds what the instability and the noise of the base motion make of the right-hand side.
fn add_of_dwells(shared: &mut Matrix4<f64>, problem: &Problem<'_>, instability: f64) {
    let mut by_coefficient = [SMatrix::<f64, 4, 5>::zeros(); 2];
    for (i, dwell) in problem.dwells.iter().enumerate() {
        let observation = problem.mean(dwell);
        let gain = problem.gain(i, &observation);
        let mut of_dwell = instability * instability;
        match &problem.motion {
            BaseMotion::Unknown | BaseMotion::Still => {}
            BaseMotion::Moving(Method::Slopes { variance: [pitch, roll] }) if dwell.time_spread > 0.0 => {
                of_dwell +=
                    (dwell.sin * dwell.sin * pitch + dwell.cos * dwell.cos * roll) / f64::from(dwell.time_spread);
            }
            BaseMotion::Moving(Method::Slopes { .. }) => {}
            // It is in the weights.
            BaseMotion::Moving(Method::Path(_)) if problem.correlated.is_some() => {}
            BaseMotion::Moving(Method::Path(path)) => {
                let rates = path.rates(dwell);
                let [pitch, roll] = &mut by_coefficient;
                *pitch -= dwell.sin * gain * rates.transpose();
                *roll += dwell.cos * gain * rates.transpose();
            }
        }
        *shared += of_dwell * gain * gain.transpose();
    }
    if let Some(path) = problem.path() {
        for (by_coefficient, covariance) in by_coefficient.iter().zip(path.covariance()) {
            *shared += by_coefficient * covariance * by_coefficient.transpose();
        }
    }
}

fn mean_tilt(dwells: &[DwellSummary]) -> Option<Tilt> {
    let (mut forward, mut left, mut seconds) = (0.0, 0.0, 0.0);
    for dwell in dwells {
        let level = dwell.specific()?;
        forward += level.forward * dwell.seconds;
        left += level.left * dwell.seconds;
        seconds += dwell.seconds;
    }
    Specific::new(forward / seconds, left / seconds).map(|level| level.tilt())
}

//! From dwells to a fix: noise, drift, misfit, sigma and flags.

use nalgebra::{Matrix4, SMatrix, Vector4};

use super::azimuth_effects::AzimuthEffects;
use super::base_motion::{self, BaseMotion, Method};
use super::doubt::{self, Correlated};
use super::dwell::DwellSummary;
use super::estimate::{Estimate, LEAST_DRIFT, settle_drift, variance_of_successive_residuals};
use super::noise::Noise;
use super::observation::regular_inverse;
use super::problem::Problem;
use super::sinusoid::Fitted;
use super::statistics::chi_square_z_score;
use super::{Declared, Fix, Unsolvable};
use crate::earth::EarthRate;
use crate::effects::ErrorModel;
use crate::health::{Flag, Flags};
use crate::level::{Specific, Tilt};
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
/// Relative amplitude error that is not held against a fix: scale factor and latitude of an honest instrument.
const AMPLITUDE_TOLERANCE: f64 = 0.01;
/// Sums of squares that differ by this many variances tell two causes apart: three standard deviations.
const DECIDED: f64 = 9.0;
/// Beyond this scale factor error and this error of the latitude an amplitude is not the Earth's.
const SCALE_LIMIT: f64 = 0.1;
const LATITUDE_LIMIT_DEG: f64 = 10.0;
/// Most azimuths that are supposed one after the other, and how nearly two in a row agree, degrees: a hundredth of the best sigma there is.
const AZIMUTH_STEPS: usize = 8;
const AZIMUTH_AGREES_DEG: f64 = 1e-4;
/// Scatter above this multiple of the declared noise is flagged.
const NOISY_RATIO: f64 = 3.0;

/// Solves for the azimuth. `dwells` in the order of time.
///
/// Where the index reading jumped while the motor stood, either the spindle moved, and the readings are right, or the encoder
/// slipped on it, and from there on they are wrong by the jump. A gyro that turns by Δθ at an azimuth ψ − θ of its axis reads
/// h sin(ψ − θ) Δθ more: the rates themselves say which it was, where they can. Where they cannot, sigma holds both.
///
/// Where the levels change, either the base moved, which turned the gyro too, or the accelerometers drifted, which the gyro knows nothing of. The base
/// is supposed to have moved unless the rates contradict it.
pub fn solve(dwells: &[DwellSummary], declared: &Declared, model: &ErrorModel) -> Result<Fix, Unsolvable> {
    let motion = base_motion(dwells);
    let moves = matches!(motion, BaseMotion::Moving(_));
    let moved = solve_for_motion(dwells, declared, model, motion);
    if !moves {
        return moved.map(|(solution, _)| solution);
    }
    match (moved, solve_for_motion(dwells, declared, model, BaseMotion::Still)) {
        (Ok(moved), Ok(still)) if moved.1 - still.1 > DECIDED => Ok(still.0),
        (Ok(only), _) | (Err(_), Ok(only)) => Ok(only.0),
        (Err(refusal), Err(_)) => Err(refusal),
    }
}

/// The solution for what is to be taken out of the base's motion, and its sum of squares in variances of the noise.
fn solve_for_motion(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
) -> Result<(Fix, f64), Unsolvable> {
    let spindle = solve_for(dwells, declared, model, motion, false);
    if dwells.iter().all(|dwell| dwell.slip_deg == 0.0) {
        return spindle;
    }
    let (mut better, mut other) = match (spindle, solve_for(dwells, declared, model, motion, true)) {
        (Ok(spindle), Ok(encoder)) if encoder.1 < spindle.1 => (encoder, spindle),
        (Ok(spindle), Ok(encoder)) => (spindle, encoder),
        (Ok(only), Err(_)) | (Err(_), Ok(only)) => (only, only),
        (Err(refusal), Err(_)) => return Err(refusal),
    };
    if other.1 - better.1 > DECIDED {
        other = better;
    }
    let apart_deg = wrap_180_deg(other.0.azimuth_deg - better.0.azimuth_deg);
    better.0.sigma_deg = libm::hypot(better.0.sigma_deg, apart_deg);
    better.0.flags.insert(Flag::IndexSlip);
    Ok(better)
}

/// The solution of one cause of jumps, and its sum of squares by the variance of the noise.
fn solve_for(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
    encoder_slipped: bool,
) -> Result<(Fix, f64), Unsolvable> {
    let earth = declared.earth;
    let start_s = dwells.first().ok_or(Unsolvable::TooFewDirections)?.start_s;
    let mut problem = Problem {
        dwells,
        earth,
        motion,
        start_s,
        sinusoid: None,
        noise: None,
        correlated: None,
        encoder_slipped,
        at_azimuth: None,
    };
    let mut flags = Flags::default();

    let noise_deg_h = declared.gyro.noise_deg_h();
    let noise = Noise::new(dwells, noise_deg_h, || variance_of_successive_residuals(&problem))
        .ok_or(Unsolvable::TooFewDirections)?;
    let variance = noise.variance;
    problem.noise = Some(noise);
    if noise.white > NOISY_RATIO * NOISY_RATIO * noise_deg_h * noise_deg_h && noise_deg_h > 0.0 {
        flags.insert(Flag::Noisy);
    }

    let drift_sigma = declared.gyro.drift_deg_h_per_h.max(LEAST_DRIFT);
    if let Some(sinusoid) = model.sinusoid {
        let drift_weight = variance / (drift_sigma * drift_sigma);
        let fitted = Fitted::new(sinusoid, dwells, &|dwell| problem.observations(dwell), variance, drift_weight);
        problem.sinusoid = Some(fitted.ok_or(Unsolvable::TooFewDirections)?);
    }
    let unsettled_deg = settle_azimuth(&mut problem, model, variance, drift_sigma)?;
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

    let determined = if drift.free { 4 } else { 3 };
    let inflation = match estimate.count.checked_sub(determined) {
        None | Some(0) => {
            flags.insert(Flag::NoRedundancy);
            1.0
        }
        Some(degrees_of_freedom) => {
            let z_score = chi_square_z_score(estimate.residual / variance, degrees_of_freedom as f64);
            if z_score > MISFIT_SIGMAS {
                flags.insert(Flag::Misfit);
            }
            if z_score > INFLATION_SIGMAS { estimate.residual / variance / degrees_of_freedom as f64 } else { 1.0 }
        }
    };

    let &[cos_part, sin_part, bias_deg_h, drift_deg_h_per_h] = estimate.parameters.as_ref();
    let amplitude_deg_h = libm::hypot(cos_part, sin_part);
    let correlated = correlated_covariance(&problem, estimate, declared, model);
    let inverse = problem.sinusoid.map_or(estimate.inverse, |sinusoid| estimate.inverse + sinusoid.doubt);
    let covariance = inverse * (variance * inflation.max(widening)) + correlated;
    let along = Vector4::new(cos_part, sin_part, 0.0, 0.0) / amplitude_deg_h;
    let amplitude_sigma = libm::sqrt(along.dot(&(covariance * along)));
    let sigmas = if doubt::is_any(&model.doubt) { SIGNAL_SIGMAS_IN_DOUBT } else { SIGNAL_SIGMAS };
    let significant = amplitude_deg_h > sigmas * amplitude_sigma;
    if !significant {
        return Err(Unsolvable::NoSignal);
    }
    let [least_deg_h, most_deg_h] = plausible_amplitude_deg_h(&earth);
    if !(least_deg_h - 4.0 * amplitude_sigma..=most_deg_h + 4.0 * amplitude_sigma).contains(&amplitude_deg_h) {
        return Err(Unsolvable::NotEarthRate);
    }
    if bias_deg_h.abs() > declared.gyro.bias_limit_deg_h + 4.0 * libm::sqrt(covariance.m33) {
        flags.insert(Flag::Bias);
    }
    if (amplitude_deg_h - earth.north_deg_h).abs() > 4.0 * amplitude_sigma + AMPLITUDE_TOLERANCE * earth.north_deg_h {
        flags.insert(Flag::Amplitude);
    }
    if matches!(problem.motion, BaseMotion::Moving(_)) || dwells.iter().any(|dwell| dwell.base_taken_out) {
        flags.insert(Flag::BaseMotion);
    }
    if dwells.iter().any(|dwell| dwell.outliers > 0) {
        flags.insert(Flag::Shock);
    }
    let tilt = mean_tilt(dwells);
    if tilt.is_none() {
        flags.insert(Flag::TiltUnknown);
    }

    let gradient = estimate.gradient();
    let of_rates_deg = libm::sqrt(gradient.dot(&(covariance * gradient))) * DEG_PER_RAD;
    // The azimuth error is the weighted mean of the index errors; over the positions of a fix the root sum of squares of
    // the weights lies between 1/2 and 1/√2. A level error τ about the north line turns the azimuth by τ tan φ.
    let of_index_deg = declared.index_sigma_deg * core::f64::consts::FRAC_1_SQRT_2;
    let of_level_deg = declared.level_sigma_deg * earth.up_deg_h / earth.north_deg_h;
    let closure_deg_h = closure(&problem);
    let apparent_deg = estimate.azimuth_deg();
    let azimuth_deg = model.true_azimuth_deg(apparent_deg, &earth);
    let solution = Fix {
        azimuth_deg,
        sigma_deg: libm::sqrt(
            [of_rates_deg, of_index_deg, of_level_deg, drift.doubt_deg, unsettled_deg, model.doubt.azimuth_sigma_deg]
                .iter()
                .map(|part| part * part)
                .sum(),
        ),
        closure_deg_h,
        bias_deg_h,
        amplitude_deg_h,
        drift_deg_h_per_h,
        tilt,
        seconds: dwells.iter().map(|dwell| dwell.seconds).sum(),
        flags,
    };
    Ok((solution, estimate.residual / variance))
}

/// Weighs the dwells by what is not certain of the model. Never inlined: two matrices of all dwells would stand twice on the stack.
#[inline(never)]
fn weigh_doubt(problem: &mut Problem<'_>, model: &ErrorModel, variance: f64) {
    problem.correlated = Correlated::new(&model.doubt, problem.dwells, &|dwell| problem.with_doubts(dwell), variance);
}

/// Where the model depends on the azimuth, supposes one, and the next by that, until they agree: by how much the last two differ, degrees.
fn settle_azimuth<'a>(
    problem: &mut Problem<'a>,
    model: &'a ErrorModel,
    variance: f64,
    drift_sigma: f64,
) -> Result<f64, Unsolvable> {
    if !model.needs_azimuth() {
        return Ok(0.0);
    }
    let azimuth_deg = |problem: &Problem<'_>| {
        let estimate = Estimate::new(problem, variance / (drift_sigma * drift_sigma));
        estimate.map(|estimate| estimate.azimuth_deg()).ok_or(Unsolvable::TooFewDirections)
    };
    let mut supposed_deg = azimuth_deg(problem)?;
    let mut apart_deg: f64 = 0.0;
    for _ in 0..AZIMUTH_STEPS {
        problem.at_azimuth = Some(AzimuthEffects::new(model, problem.earth, supposed_deg));
        weigh_doubt(problem, model, variance);
        let next_deg = azimuth_deg(problem)?;
        apart_deg = wrap_180_deg(next_deg - supposed_deg).abs();
        supposed_deg = next_deg;
        if apart_deg < AZIMUTH_AGREES_DEG {
            break;
        }
    }
    problem.at_azimuth = Some(AzimuthEffects::new(model, problem.earth, supposed_deg));
    Ok(if apart_deg < AZIMUTH_AGREES_DEG { 0.0 } else { apart_deg })
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
            BaseMotion::Moving(Method::Path(path)) => {
                let rates = path.rates(dwell);
                let [pitch, roll] = &mut by_coefficient;
                *pitch -= dwell.sin * gain * rates.transpose();
                *roll += dwell.cos * gain * rates.transpose();
            }
        }
        *shared += of_dwell * gain * gain.transpose();
    }
    if let BaseMotion::Moving(Method::Path(path)) = &problem.motion {
        for (by_coefficient, covariance) in by_coefficient.iter().zip(path.covariance()) {
            *shared += by_coefficient * covariance * by_coefficient.transpose();
        }
    }
}

/// The cos 2θ coefficient beside amplitude and bias, without a drift (which it shows).
fn closure(problem: &Problem<'_>) -> Option<f64> {
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for dwell in problem.dwells {
        let mut observation = problem.mean(dwell);
        observation.row.w = observation.cos_2theta;
        observation.add_to(&mut normal, &mut right);
    }
    // At 45°, 135°, … the second harmonic that this one looks for is nothing.
    if normal.m44 < 1e-3 * normal.m33 {
        return None;
    }
    let inverse = regular_inverse(&normal)?;
    Some((inverse * right).w)
}

/// What is left to be taken out of the base's motion.
fn base_motion(dwells: &[DwellSummary]) -> BaseMotion {
    if dwells.iter().any(|dwell| dwell.base_taken_out) { BaseMotion::Still } else { base_motion::detect(dwells) }
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

//! Rates at index angles to azimuth, sigma and closure.
//!
//! A gyro whose sensitive axis is at index θ on an instrument with azimuth ψ, pitch p and roll r reads
//!
//! ω = h·(C cos ψ + S sin ψ) + Ω sin φ · (upward component of the axis) + bias + drift · t,
//!
//! with h = Ω cos φ, C = cos θ cos p − sin θ sin r sin p and S = sin θ cos r: linear in h cos ψ, h sin ψ, bias and drift.
//! (Level, this is ω = h cos(ψ − θ) + bias.) The solution is weighted least squares with the amplitude free; for four
//! positions of equal length it is ψ = atan2(ω90 − ω270, ω0 − ω180).
//!
//! Sigma comes from the scatter of the data, never below what the declared noise allows, and grows where the dwells do
//! not fit together; the declared bias instability, encoder and level errors are added, and what is not certain of the
//! error model ([`doubt`]).

pub mod accumulator;
pub mod base_motion;
pub mod design;
mod doubt;
pub mod dwell;
pub mod index_watch;
pub mod moving_base;
mod noise;
#[cfg(test)]
mod parked_vehicle;
pub mod room;
pub mod sinusoid;
mod statistics;
#[cfg(test)]
mod tests;
mod velocity;

use nalgebra::{Matrix4, SMatrix, Vector4};
use serde::{Deserialize, Serialize};

use crate::earth::EarthRate;
use crate::effects::ErrorModel;
use crate::health::{Flag, Flags};
use crate::index::Direction;
use crate::level::{Specific, Tilt};
use crate::sample::GyroSettings;
use crate::slices::pause;
use crate::units::{DEG_PER_RAD, RAD_PER_DEG, sin_cos_deg, wrap_180_deg, wrap_360_deg};
use base_motion::{BaseMotion, Method};
pub use design::DesignRow;
use doubt::Correlated;
pub use doubt::ROOM;
use dwell::DwellSummary;
use noise::Noise;
use room::Room;
use sinusoid::Fitted;
use statistics::excess_sigmas;

/// A chi-square this many standard deviations above its mean is a misfit.
const MISFIT_SIGMAS: f64 = 3.0;
/// From this many on, sigma grows with the misfit. Lower than the flag's, so that a sigma is rather too large.
const INFLATION_SIGMAS: f64 = 2.0;
/// A drift further from nothing than this many sigmas (declared and estimated together) is estimated freely.
const DRIFT_SIGMAS: f64 = 3.0;
/// From this many on, sigma grows by what the drift could do.
const DRIFT_DOUBT_SIGMAS: f64 = 2.0;
/// Relative amplitude error that is not held against a fix: scale factor and latitude of an honest instrument.
const AMPLITUDE_TOLERANCE: f64 = 0.01;
/// Sums of squares that differ by this many variances tell two causes apart: three standard deviations.
const DECIDED: f64 = 9.0;
/// Beyond this scale factor error and this error of the latitude an amplitude is not the Earth's.
const SCALE_LIMIT: f64 = 0.1;
const LATITUDE_LIMIT_DEG: f64 = 10.0;
/// Scatter above this multiple of the declared noise is flagged.
const NOISY_RATIO: f64 = 3.0;
/// Dwells whose sums make one slice.
const FEW: usize = 8;
/// A drift that is declared as none is still allowed this much, °/h per hour, to keep the equations regular.
const LEAST_DRIFT: f64 = 1e-6;

/// What a solution rests on beside the data: what is declared of the instrument, and the Earth's rate at its site.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Declared {
    pub earth: EarthRate,
    pub gyro: GyroSettings,
    /// One sigma of the encoder's error at one position, degrees.
    pub index_sigma_deg: f64,
    /// One sigma of the accelerometers' level error, degrees.
    pub level_sigma_deg: f64,
    /// An error model from a calibration is stored.
    pub calibrated: bool,
}

/// Unknowns of a fix with a free drift.
const PARAMETERS: usize = 4;

/// An azimuth with all that says how far to trust it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// Azimuth of the index-zero mark, degrees clockwise from true north, in [0°, 360°).
    pub azimuth_deg: f64,
    /// Its standard deviation, degrees.
    pub sigma_deg: f64,
    /// (ω0 + ω180 − ω90 − ω270)/4 and, for any other set of angles, the cos 2θ coefficient of the rates, °/h;
    /// `None` where the angles cannot show it. Noise, when all is well.
    pub closure_deg_h: Option<f64>,
    /// Gyro bias that the fix found, °/h, beyond the error model's.
    pub bias_deg_h: f64,
    /// Horizontal rate that the fix found, °/h; should be Ω cos φ.
    pub amplitude_deg_h: f64,
    /// Linear bias drift that the fix found, °/h per hour; 0 where the order cannot tell it and none was declared.
    pub drift_deg_h_per_h: f64,
    /// Mean tilt during the fix; `None` without level accelerometers.
    pub tilt: Option<Tilt>,
    /// Measuring time that entered, seconds.
    pub seconds: f64,
    /// Everything that limits the trust in it.
    pub flags: Flags,
}

/// Why there is no azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsolvable {
    /// Fewer than three different directions.
    TooFewDirections,
    /// The horizontal rate is not significant against its own uncertainty.
    NoSignal,
    /// The horizontal rate is significant, and not the Earth's at this latitude or one near it.
    NotEarthRate,
    /// More dwells than there is room for.
    TooManyDwells,
}

impl core::fmt::Display for Unsolvable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooFewDirections => "the gyro was at rest in fewer than three different directions",
            Self::NoSignal => "Earth rate not detected above the noise; no azimuth",
            Self::NotEarthRate => {
                "the horizontal rate is not the Earth's, whatever scale factor and latitude error are granted; no azimuth"
            }
            Self::TooManyDwells => "more dwells than there is room for",
        })
    }
}

/// One weighted observation: variance is s²/weight with s² the variance of a one-second rate.
struct Observation {
    weight: f64,
    /// Factors of h cos ψ, h sin ψ, bias, drift (per hour).
    row: Vector4<f64>,
    /// Cosine of twice the index angle, for the closure.
    cos_2theta: f64,
    rate_deg_h: f64,
}

impl Observation {
    /// Adds to the lower triangle of the normal matrix and to the right-hand side. A slope has the drift alone: what is nothing is
    /// not reckoned with, which takes a board half of its time.
    fn add_to(&self, normal: &mut Matrix4<f64>, right: &mut Vector4<f64>) {
        let row = self.row.as_slice();
        for (i, a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            let weighted = self.weight * a;
            for (j, b) in row.iter().enumerate().take(i + 1).filter(|(_, b)| **b != 0.0) {
                if let Some(entry) = normal.get_mut((i, j)) {
                    *entry += weighted * b;
                }
            }
            if let Some(entry) = right.get_mut(i) {
                *entry += weighted * self.rate_deg_h;
            }
        }
    }
}

/// The dwells of a fix with what belongs to all of them.
struct Problem<'a> {
    dwells: &'a [DwellSummary],
    room: Room<'a>,
    earth: EarthRate,
    motion: BaseMotion,
    start_s: f64,
    line: Option<Fitted>,
    noise: Option<Noise>,
    /// What is not certain of the error model.
    correlated: Option<Correlated<'a>>,
    /// Where the index reading jumped while the motor stood, the encoder slipped and the gyro stayed where it was.
    encoder_slipped: bool,
}

impl Problem<'_> {
    /// True direction of the index at a dwell.
    fn index(&self, dwell: &DwellSummary) -> Direction {
        let Direction { cos, sin } = Direction { cos: dwell.cos, sin: dwell.sin };
        if !self.encoder_slipped {
            return Direction { cos, sin };
        }
        let (sin_slip, cos_slip) = sin_cos_deg(dwell.slip_deg.into());
        Direction { cos: cos * cos_slip + sin * sin_slip, sin: sin * cos_slip - cos * sin_slip }
    }

    /// Mean and slope of a dwell, the Earth's vertical rate and the base's turning taken out.
    async fn observations(&self, dwell: &DwellSummary) -> [Observation; 2] {
        let index = self.index(dwell);
        let design = DesignRow::new(index, specific(dwell), &self.earth);
        let (mean_deg_h, weight) = self.noise.map_or((dwell.rate.mean, dwell.seconds), |noise| noise.mean(dwell));
        let weight_of_slope = self.noise.map_or(dwell.time_spread.into(), |noise| noise.weight_of_slope(dwell));
        if matches!(self.motion, BaseMotion::Moving(_)) || self.encoder_slipped {
            pause().await;
        }
        let rate_deg_h = mean_deg_h - design.vertical_deg_h - self.base_rate_deg_h(dwell);
        let hours = (dwell.t_s - self.start_s) / 3600.0;
        let [line_deg_h, line_deg_h_per_h] = match &self.line {
            None => [0.0; 2],
            Some(line) => {
                pause().await;
                line.of_dwell(dwell)
            }
        };
        [
            Observation {
                weight,
                row: Vector4::new(design.cos, design.sin, 1.0, hours),
                cos_2theta: index.cos * index.cos - index.sin * index.sin,
                rate_deg_h: rate_deg_h - line_deg_h,
            },
            Observation {
                weight: weight_of_slope / (3600.0 * 3600.0),
                row: Vector4::new(0.0, 0.0, 0.0, 1.0),
                cos_2theta: 0.0,
                rate_deg_h: dwell.rate.slope_per_s * 3600.0 - line_deg_h_per_h,
            },
        ]
    }

    /// The mean alone.
    async fn mean(&self, dwell: &DwellSummary) -> Observation {
        let [mean, _] = self.observations(dwell).await;
        mean
    }

    /// The observations with errors that are independent of each other.
    async fn for_each(&self, take: &mut dyn FnMut(Observation)) {
        if let Some(correlated) = &self.correlated {
            return correlated.for_each(self, take).await;
        }
        for dwell in self.dwells {
            self.observations(dwell).await.into_iter().for_each(&mut *take);
            pause().await;
        }
    }

    /// What an error of a dwell's rate adds to the right-hand side of the normal equations.
    fn gain(&self, dwell: usize, observation: &Observation) -> Vector4<f64> {
        self.correlated.map_or(observation.weight * observation.row, |correlated| correlated.gain(dwell))
    }

    /// What the base's turning adds to the gyro's rate at a dwell, °/h: cos θ · dr/dt − sin θ · dp/dt.
    fn base_rate_deg_h(&self, dwell: &DwellSummary) -> f64 {
        let [pitch_deg_h, roll_deg_h] = match &self.motion {
            BaseMotion::Unknown | BaseMotion::Still => return 0.0,
            BaseMotion::Moving(Method::Slopes { .. }) => base_motion::slopes_deg_h(dwell),
            BaseMotion::Moving(Method::Path(path)) => {
                let rates = path.rates(dwell);
                path.coefficients().map(|coefficients| rates.dot(&coefficients))
            }
        };
        dwell.cos * roll_deg_h - dwell.sin * pitch_deg_h
    }
}

impl Problem<'_> {
    /// Where there are too few rows in a dwell to tell the noise (a continuous rotation): variance of a one-second rate,
    /// (°/h)², from the differences of successive residuals.
    async fn variance_of_successive_residuals(&self) -> Option<f64> {
        let parameters = Estimate::new(self, LEAST_DRIFT).await?.parameters;
        let (mut last, mut sum, mut pairs) = (None, 0.0, 0.0);
        for dwell in self.dwells {
            let Observation { weight, row, rate_deg_h, .. } = self.mean(dwell).await;
            if weight > 0.0 {
                let (residual, share) = (rate_deg_h - row.dot(&parameters), 1.0 / weight);
                if let Some((before, share_before)) = last.replace((residual, share)) {
                    let difference: f64 = residual - before;
                    sum += difference * difference / (share + share_before);
                    pairs += 1.0;
                }
            }
            pause().await;
        }
        (pairs > 0.0).then(|| sum / pairs)
    }
}

/// A least-squares estimate of h cos ψ, h sin ψ, bias and drift.
struct Estimate {
    parameters: Vector4<f64>,
    /// Inverse of the normal matrix; times the variance of a one-second rate, the covariance.
    inverse: Matrix4<f64>,
    /// Weighted sum of squares that is left.
    left: f64,
    /// Observations of some weight.
    count: usize,
}

impl Estimate {
    /// With `drift_weight` = s²/σ² of the declared drift about zero; 0 estimates the drift freely.
    async fn new(problem: &Problem<'_>, drift_weight: f64) -> Option<Self> {
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        problem.for_each(&mut |observation| observation.add_to(&mut normal, &mut right)).await;
        normal.m44 += drift_weight;
        let inverse = regular_inverse(&normal)?;
        pause().await;
        let parameters = inverse * right;
        let (mut left, mut count) = (drift_weight * parameters.w * parameters.w, 0);
        let mut judge = |Observation { weight, row, rate_deg_h, .. }: Observation| {
            let residual = rate_deg_h - row.dot(&parameters);
            left += weight * residual * residual;
            count += usize::from(weight > 0.0);
        };
        problem.for_each(&mut judge).await;
        Some(Self { parameters, inverse, left, count })
    }

    fn azimuth_deg(&self) -> f64 {
        wrap_360_deg(libm::atan2(self.parameters.y, self.parameters.x) * DEG_PER_RAD)
    }

    /// Direction derivative of the azimuth: dψ/d(h cos ψ, h sin ψ, …), rad per °/h.
    fn gradient(&self) -> Vector4<f64> {
        let &[x, y, _, _] = self.parameters.as_ref();
        let squared = x * x + y * y;
        Vector4::new(-y / squared, x / squared, 0.0, 0.0)
    }
}

/// Inverse by Cholesky of a symmetric matrix, given by its lower triangle; `None` where a direction is not determined.
///
/// Without multiplying by nothing: on a board a product of two matrices takes as long as all of this.
#[inline(never)]
fn regular_inverse(normal: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    // L⁻¹ row by row, where row i of L is what the rows of L⁻¹ before it leave of row i of the matrix.
    let mut inverse_factor = Matrix4::zeros();
    for i in 0..PARAMETERS {
        let whole = at(normal, i, i);
        let (mut rest, mut row) = (whole, [0.0; PARAMETERS]);
        for k in 0..i {
            let entry: f64 = (0..=k).map(|j| at(&inverse_factor, k, j) * at(normal, i, j)).sum();
            rest -= entry * entry;
            for (j, sum) in row.iter_mut().enumerate().take(k + 1) {
                *sum -= entry * at(&inverse_factor, k, j);
            }
        }
        // The share of an unknown that the others do not explain.
        if !(rest >= 1e-6 * whole && rest > 0.0 && rest.is_finite()) {
            return None;
        }
        let reciprocal = 1.0 / libm::sqrt(rest);
        for (j, sum) in row.iter().enumerate().take(i) {
            set(&mut inverse_factor, i, j, sum * reciprocal);
        }
        set(&mut inverse_factor, i, i, reciprocal);
    }
    let mut inverse = Matrix4::zeros();
    for i in 0..PARAMETERS {
        for j in 0..=i {
            let entry = (i..PARAMETERS).map(|k| at(&inverse_factor, k, i) * at(&inverse_factor, k, j)).sum();
            set(&mut inverse, i, j, entry);
            set(&mut inverse, j, i, entry);
        }
    }
    Some(inverse)
}

fn at(matrix: &Matrix4<f64>, row: usize, column: usize) -> f64 {
    matrix.get((row, column)).copied().unwrap_or_default()
}

fn set(matrix: &mut Matrix4<f64>, row: usize, column: usize, value: f64) {
    if let Some(entry) = matrix.get_mut((row, column)) {
        *entry = value;
    }
}

/// Solves for the azimuth. `dwells` in the order of time.
///
/// Where the index reading jumped while the motor stood, either the spindle moved, and the readings are right, or the encoder
/// slipped on it, and from there on they are wrong by the jump. A gyro that turns by Δθ at an azimuth ψ − θ of its axis reads
/// h sin(ψ − θ) Δθ more: the rates themselves say which it was, where they can. Where they cannot, sigma holds both.
///
/// `room`: for [`ROOM`] numbers.
pub async fn solve(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    room: Room<'_>,
) -> Result<Fix, Unsolvable> {
    let spindle = solve_for(dwells, declared, model, room, false).await;
    if dwells.iter().all(|dwell| dwell.slip_deg == 0.0) {
        return spindle.map(|(solution, _)| solution);
    }
    let (mut better, mut other) = match (spindle, solve_for(dwells, declared, model, room, true).await) {
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
    Ok(better.0)
}

/// The solution of one cause of jumps, and its sum of squares by the variance of the noise.
async fn solve_for(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    room: Room<'_>,
    encoder_slipped: bool,
) -> Result<(Fix, f64), Unsolvable> {
    let earth = declared.earth;
    let start_s = dwells.first().ok_or(Unsolvable::TooFewDirections)?.start_s;
    let mut problem = Problem {
        dwells,
        room,
        earth,
        motion: base_motion(dwells).await,
        start_s,
        line: None,
        noise: None,
        correlated: None,
        encoder_slipped,
    };
    let mut flags = Flags::default();

    let noise_deg_h = declared.gyro.noise_deg_h();
    let noise = Noise::new(&problem, noise_deg_h).await.ok_or(Unsolvable::TooFewDirections)?;
    let variance = noise.variance;
    problem.noise = Some(noise);
    if noise.white > NOISY_RATIO * NOISY_RATIO * noise_deg_h * noise_deg_h && noise_deg_h > 0.0 {
        flags.insert(Flag::Noisy);
    }

    let drift_sigma = declared.gyro.drift_deg_h_per_h.max(LEAST_DRIFT);
    if let Some(sinusoid) = model.sinusoid {
        let drift_weight = variance / (drift_sigma * drift_sigma);
        let fitted = Fitted::new(sinusoid, &problem, variance, drift_weight).await;
        problem.line = Some(fitted.ok_or(Unsolvable::TooFewDirections)?);
    }
    problem.correlated = Correlated::new(&model.doubt, &problem, variance).await;
    let drift = settle_drift(&problem, variance, drift_sigma).await?;
    pause().await;
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
        Some(freedom) => {
            let excess = excess_sigmas(estimate.left / variance, freedom as f64);
            if excess > MISFIT_SIGMAS {
                flags.insert(Flag::Misfit);
            }
            if excess > INFLATION_SIGMAS { estimate.left / variance / freedom as f64 } else { 1.0 }
        }
    };

    pause().await;
    let &[cos_part, sin_part, bias_deg_h, drift_deg_h_per_h] = estimate.parameters.as_ref();
    let amplitude_deg_h = libm::hypot(cos_part, sin_part);
    let correlated = correlated_covariance(&problem, estimate, declared, model).await;
    let inverse = problem.line.map_or(estimate.inverse, |line| estimate.inverse + line.doubt);
    let covariance = inverse * (variance * inflation.max(widening)) + correlated;
    pause().await;
    let along = Vector4::new(cos_part, sin_part, 0.0, 0.0) / amplitude_deg_h;
    let amplitude_sigma = libm::sqrt(along.dot(&(covariance * along)));
    let significant = amplitude_deg_h > 5.0 * amplitude_sigma;
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
    pause().await;
    let tilt = mean_tilt(dwells).await;
    if tilt.is_none() {
        flags.insert(Flag::TiltUnknown);
    }

    let gradient = estimate.gradient();
    let of_rates_deg = libm::sqrt(gradient.dot(&(covariance * gradient))) * DEG_PER_RAD;
    // The azimuth error is the weighted mean of the index errors; over the positions of a fix the root sum of squares of
    // the weights lies between 1/2 and 1/√2. A level error τ about the north line turns the azimuth by τ tan φ.
    let of_index_deg = declared.index_sigma_deg * core::f64::consts::FRAC_1_SQRT_2;
    let of_level_deg = declared.level_sigma_deg * earth.up_deg_h / earth.north_deg_h;
    pause().await;
    let closure_deg_h = closure(&problem).await;
    pause().await;
    let apparent_deg = estimate.azimuth_deg();
    pause().await;
    let azimuth_deg = model.true_azimuth_deg(apparent_deg, &earth);
    let solution = Fix {
        azimuth_deg,
        sigma_deg: libm::sqrt(
            [of_rates_deg, of_index_deg, of_level_deg, drift.doubt_deg, model.doubt.azimuth_sigma_deg]
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
    Ok((solution, estimate.left / variance))
}

/// How the drift was dealt with.
struct Drift {
    estimate: Estimate,
    /// It was estimated freely; else it was held to its declaration.
    free: bool,
    /// What an undecided drift could do to the azimuth, degrees.
    doubt_deg: f64,
}

/// With the drift held to its declaration if the data allow it, else free; undecided in between.
async fn settle_drift(problem: &Problem<'_>, variance: f64, drift_sigma: f64) -> Result<Drift, Unsolvable> {
    let declared =
        Estimate::new(problem, variance / (drift_sigma * drift_sigma)).await.ok_or(Unsolvable::TooFewDirections)?;
    // A drift that takes the last redundancy would explain whatever is wrong.
    let Some(free) = Estimate::new(problem, 0.0).await.filter(|free| free.count > PARAMETERS) else {
        return Ok(Drift { estimate: declared, free: false, doubt_deg: 0.0 });
    };
    let spread = drift_sigma * drift_sigma + variance * free.inverse.m44;
    let sigmas = libm::sqrt(free.parameters.w * free.parameters.w / spread);
    if sigmas > DRIFT_SIGMAS {
        return Ok(Drift { estimate: free, free: true, doubt_deg: 0.0 });
    }
    let doubt_deg =
        if sigmas > DRIFT_DOUBT_SIGMAS { wrap_180_deg(free.azimuth_deg() - declared.azimuth_deg()).abs() } else { 0.0 };
    Ok(Drift { estimate: declared, free: false, doubt_deg })
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
async fn correlated_covariance(
    problem: &Problem<'_>,
    estimate: &Estimate,
    declared: &Declared,
    model: &ErrorModel,
) -> Matrix4<f64> {
    // In functions of their own: what is kept from slice to slice has room for the largest of them, and not for all.
    let mut shared = match problem.correlated {
        None if doubt::is_any(&model.doubt) => doubt::of_right_hand_side(&model.doubt, problem).await,
        _ => Matrix4::zeros(),
    };
    add_of_dwells(&mut shared, problem, declared.gyro.bias_instability_deg_h).await;
    let half = product(&estimate.inverse, &shared).await;
    product(&half, &estimate.inverse).await
}

/// Adds what the instability and the noise of the base motion make of the right-hand side.
async fn add_of_dwells(shared: &mut Matrix4<f64>, problem: &Problem<'_>, instability: f64) {
    let mut by_coefficient = [SMatrix::<f64, 4, 5>::zeros(); 2];
    for (i, dwell) in problem.dwells.iter().enumerate() {
        let observation = problem.mean(dwell).await;
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
                pause().await;
                let rates = path.rates(dwell);
                let [pitch, roll] = &mut by_coefficient;
                *pitch -= dwell.sin * gain * rates.transpose();
                pause().await;
                *roll += dwell.cos * gain * rates.transpose();
            }
        }
        *shared += of_dwell * gain * gain.transpose();
        pause().await;
    }
    if let BaseMotion::Moving(Method::Path(path)) = &problem.motion {
        for (by_coefficient, covariance) in by_coefficient.iter().zip(path.covariance()) {
            let half = product(by_coefficient, covariance).await;
            *shared += product(&half, &by_coefficient.transpose()).await;
        }
    }
}

/// The product of two matrices, a column a slice.
async fn product<const R: usize, const K: usize, const C: usize>(
    left: &SMatrix<f64, R, K>,
    right: &SMatrix<f64, K, C>,
) -> SMatrix<f64, R, C> {
    let mut product = SMatrix::<f64, R, C>::zeros();
    let (columns, of_right) = (product.as_mut_slice().as_chunks_mut::<R>().0, right.as_slice().as_chunks::<K>().0);
    for (column, of_right) in columns.iter_mut().zip(of_right) {
        for (of_left, factor) in left.as_slice().as_chunks::<R>().0.iter().zip(of_right) {
            column.iter_mut().zip(of_left).for_each(|(sum, part)| *sum += part * factor);
        }
        pause().await;
    }
    product
}

/// The cos 2θ coefficient beside amplitude and bias, without a drift (which it shows).
async fn closure(problem: &Problem<'_>) -> Option<f64> {
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for dwell in problem.dwells {
        let mut observation = problem.mean(dwell).await;
        observation.row.w = observation.cos_2theta;
        observation.add_to(&mut normal, &mut right);
        pause().await;
    }
    // At 45°, 135°, … the second harmonic that this one looks for is nothing.
    if normal.m44 < 1e-3 * normal.m33 {
        return None;
    }
    let inverse = regular_inverse(&normal)?;
    pause().await;
    Some((inverse * right).w)
}

/// What is left to be taken out of the base's motion.
async fn base_motion(dwells: &[DwellSummary]) -> BaseMotion {
    if dwells.iter().any(|dwell| dwell.base_taken_out) { BaseMotion::Still } else { base_motion::detect(dwells).await }
}

/// Upward components of the instrument's axes during a dwell.
fn specific(dwell: &DwellSummary) -> Option<Specific> {
    dwell.level.map(|[forward, left]| Specific { forward: forward.mean.into(), left: left.mean.into() })
}

async fn mean_tilt(dwells: &[DwellSummary]) -> Option<Tilt> {
    let (mut forward, mut left, mut seconds) = (0.0, 0.0, 0.0);
    for few in dwells.chunks(FEW) {
        for dwell in few {
            let level = specific(dwell)?;
            forward += level.forward * dwell.seconds;
            left += level.left * dwell.seconds;
            seconds += dwell.seconds;
        }
        pause().await;
    }
    let tilt = Specific::new(forward / seconds, left / seconds).map(|level| level.tilt());
    pause().await;
    tilt
}

/// Azimuth by dwells in two directions, degrees in [0°, 360°), the gyro's bias taken as none: a bias b makes it wrong by up to
/// √2 b / (Ω cos φ). `None`: the dwells lie in one line.
///
/// Least squares of h cos ψ and h sin ψ alone, by time: enough to turn the axis nearly east.
pub async fn coarse_azimuth_deg(dwells: &[DwellSummary], earth: &EarthRate) -> Option<f64> {
    let [mut cc, mut cs, mut ss, mut cr, mut sr, mut s] = [0.0; 6];
    for dwell in dwells {
        let design = DesignRow::new(Direction { cos: dwell.cos, sin: dwell.sin }, specific(dwell), earth);
        let rate_deg_h = dwell.rate.mean - design.vertical_deg_h;
        cc += dwell.seconds * design.cos * design.cos;
        cs += dwell.seconds * design.cos * design.sin;
        ss += dwell.seconds * design.sin * design.sin;
        cr += dwell.seconds * design.cos * rate_deg_h;
        sr += dwell.seconds * design.sin * rate_deg_h;
        s += dwell.seconds;
        pause().await;
    }
    let determinant = cc * ss - cs * cs;
    let regular = determinant > 1e-3 * s * s;
    regular.then(|| wrap_360_deg(libm::atan2(cc * sr - cs * cr, ss * cr - cs * sr) * DEG_PER_RAD))
}

/// Index angle, degrees in [0°, 360°), at which the sensitive axis of an instrument with `azimuth_deg` points east.
pub fn east_index_deg(azimuth_deg: f64) -> f64 {
    wrap_360_deg(azimuth_deg - 90.0)
}

/// The same for west.
pub fn west_index_deg(azimuth_deg: f64) -> f64 {
    wrap_360_deg(azimuth_deg + 90.0)
}

/// Standard deviation in degrees that white noise alone allows: 60√2 · N / (h √T), the bound for any equally spaced
/// positions or a continuous rotation. `arw` in °/√h, `north_deg_h` = Ω cos φ, `seconds` the whole measuring time.
pub fn white_noise_bound_deg(arw_deg_per_sqrt_h: f64, north_deg_h: f64, seconds: f64) -> f64 {
    60.0 * core::f64::consts::SQRT_2 * arw_deg_per_sqrt_h / (north_deg_h * libm::sqrt(seconds)) / RAD_PER_DEG
}

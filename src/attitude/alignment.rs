//! Alignment: heading and levels of a block that stands, or sways without going anywhere.
//!
//! The gyros carry the block's axes of the beginning through the window, as if these stood still among the stars. Seen from
//! them the support against gravity turns with the Earth,
//!
//! f(t) = g up + g Ω cos φ east · t + g cos φ (sin φ north − cos φ up) Ω² t²/2 − …,
//!
//! so that its mean is up and its slope points east: heading needs nothing else. Which of its integrals is fitted decides
//! what disturbs. A still base has white noise in the force: a straight line through f. A swaying base has it in the velocity,
//! since it comes back to where it was: a parabola through the integral of f. The mean of the gyros' rates, which takes the
//! base for still altogether, is the coarse alignment.
//!
//! With white noise of the spectral density N² in the rate, an error of the rate about a horizontal axis has the variance
//! (6/5) N²/T from the line and (10/7) N²/T from the parabola (1 from the mean), and from the noise S of what is fitted
//! 12 S/g²T³ and 720 S/g²T⁵. Both are estimated: S from what a polynomial of degree six leaves, N from the orthonormal
//! coefficients above those that carry the heading, in which noise of the rate grows as S does not. N is uncertain in one
//! window, so its likelihood is averaged over rather than maximised, and windows of one recording share it ([`NoiseOfRate`]).

mod moments;
mod noise;

use nalgebra::{Matrix3, Vector3};

pub use self::noise::NoiseOfRate;

use self::moments::{COEFFICIENTS, Fit, Moments};
use super::coning::{Algorithm, Increment, Integrator};
use super::quaternion::Quaternion;
use super::rotation::Angles;
use crate::earth::{EARTH_RATE_DEG_H, LatitudeError, POLE_LIMIT_DEG, earth_rate};
use crate::units::{DEG_PER_RAD, RAD_PER_DEG};

/// Ω, rad/s.
const EARTH_RATE_RAD_S: f64 = EARTH_RATE_DEG_H * RAD_PER_DEG / 3600.0;
/// Length of the means that are fitted, s.
const BLOCK_S: f64 = 1.0;
/// Fewest of them: two more than the polynomial has coefficients.
const LEAST_BLOCKS: u32 = COEFFICIENTS as u32 + 2;
/// Length of a sample that is taken, s.
const LONGEST_SAMPLE_S: f64 = 1.0;

/// How a heading was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Means of rate and specific force, the base taken for still.
    StaticMean,
    /// A line through the specific force in inertial axes.
    ForceLine,
    /// A parabola through the velocity in inertial axes.
    VelocityParabola,
    /// The same where the latitude is not known.
    UnknownLatitude,
}

impl Method {
    /// All, from the coarsest to the finest; the last is for where there is no latitude.
    pub const ALL: [Self; 4] = [Self::StaticMean, Self::ForceLine, Self::VelocityParabola, Self::UnknownLatitude];

    /// Its name, in lower case with hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::StaticMean => "static-mean",
            Self::ForceLine => "inertial-force-line",
            Self::VelocityParabola => "inertial-velocity-parabola",
            Self::UnknownLatitude => "inertial-unknown-latitude",
        }
    }
}

/// An alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// Block axes to geographic ones at the end of the window.
    pub orientation: Quaternion,
    /// The same as heading, pitch and roll.
    pub angles: Angles,
    /// Of the heading, degrees; above 90 it says nothing.
    pub sigma_heading_deg: f64,
    /// Of pitch and roll, degrees, without the biases of the accelerometers.
    pub sigma_level_deg: f64,
    /// As given, or as found, degrees.
    pub latitude_deg: f64,
    /// Horizontal rate that was found less that of the Earth at the latitude, °/h; 0 where the latitude was not known.
    pub rate_excess_deg_h: f64,
}

/// Why there is no alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlignError {
    /// Fewer seconds than this.
    TooShort {
        seconds: f64,
        least_s: f64,
    },
    Latitude(LatitudeError),
    /// The specific force is not that of a block which stands on the Earth, m/s².
    NotGravity {
        force_m_s2: f64,
    },
    /// The horizontal rate, °/h, is not above its noise: no north.
    NoEarthRate {
        rate_deg_h: f64,
        sigma_deg_h: f64,
    },
}

impl core::fmt::Display for AlignError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooShort { seconds, least_s } => {
                write!(f, "{seconds:.1} s are too short for an alignment; {least_s:.0} s are needed")
            }
            Self::Latitude(error) => write!(f, "{error}"),
            Self::NotGravity { force_m_s2 } => {
                write!(f, "the mean specific force is {force_m_s2:.3} m/s2; a block that stands feels 9.3 to 10.3")
            }
            Self::NoEarthRate { rate_deg_h, sigma_deg_h } => write!(
                f,
                "Earth rate not detected above the noise ({rate_deg_h:.3} deg/h, sigma {sigma_deg_h:.3}); no heading"
            ),
        }
    }
}

/// Gathers a window, sample by sample, in constant memory.
#[derive(Clone, Debug)]
pub struct Alignment {
    integrator: Integrator,
    /// Block axes to inertial ones, which are the block's of the beginning.
    inertial: Quaternion,
    seconds: f64,
    /// In inertial axes, m/s.
    velocity_m_s: Vector3<f64>,
    angle_rad: Vector3<f64>,
    /// Integral of specific force along the block's own axes, m/s.
    felt_m_s: Vector3<f64>,
    block: Block,
    /// Specific force of the first block and of the last: what is fitted is reckoned from the first.
    first_force: Option<Vector3<f64>>,
    last_force: Vector3<f64>,
    force: Moments,
    velocity: Moments,
}

/// A mean in the making.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    start_s: f64,
    start_velocity: Vector3<f64>,
    weighted_velocity: Vector3<f64>,
}

impl Default for Alignment {
    fn default() -> Self {
        Self {
            integrator: Integrator::new(Algorithm::PreviousInterval),
            inertial: Quaternion::IDENTITY,
            seconds: 0.0,
            velocity_m_s: Vector3::zeros(),
            angle_rad: Vector3::zeros(),
            felt_m_s: Vector3::zeros(),
            block: Block::default(),
            first_force: None,
            last_force: Vector3::zeros(),
            force: Moments::default(),
            velocity: Moments::default(),
        }
    }
}

impl Alignment {
    /// Length of the window so far, s.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// A sample of `dt_s`, 0 … 1 s; others are left out (`false`), as are numbers that are none.
    pub fn push(&mut self, dt_s: f64, sample: Increment) -> bool {
        let finite = sample.angle_rad.iter().chain(sample.velocity_m_s.iter()).all(|part| part.is_finite());
        if !(finite && dt_s > 0.0 && dt_s <= LONGEST_SAMPLE_S) {
            return false;
        }
        let Some(interval) = self.integrator.push(sample) else { return true };
        let before = self.velocity_m_s;
        self.velocity_m_s += self.inertial.rotate(&interval.velocity_m_s);
        self.inertial = self.inertial.advance(&interval.angle_rad, &Vector3::zeros());
        self.seconds += dt_s;
        self.angle_rad += sample.angle_rad;
        self.felt_m_s += sample.velocity_m_s;
        // A trapezium: the mean of the velocity over the sample.
        self.block.weighted_velocity += (before + self.velocity_m_s) * (0.5 * dt_s);
        if self.seconds - self.block.start_s >= BLOCK_S - 0.5 * dt_s {
            self.end_block();
        }
        true
    }

    fn end_block(&mut self) {
        let Block { start_s, start_velocity, weighted_velocity } = self.block;
        let length_s = self.seconds - start_s;
        let middle_s = 0.5 * (self.seconds + start_s);
        let force = (self.velocity_m_s - start_velocity) / length_s;
        let nominal = *self.first_force.get_or_insert(force);
        self.last_force = force;
        self.force.push(middle_s, force - nominal);
        // The mean of a line over the block is its middle; that of t² is a constant more, which the offset takes.
        self.velocity.push(middle_s, weighted_velocity / length_s - nominal * middle_s);
        self.block =
            Block { start_s: self.seconds, start_velocity: self.velocity_m_s, weighted_velocity: Vector3::zeros() };
    }

    /// The likelihood of the gyros' noise in this window, to be shared with others of the same recording. `None` where there
    /// is too little to tell.
    pub fn noise(&self, latitude_deg: f64) -> Option<NoiseOfRate> {
        let latitude = Some(latitude_deg);
        let (fit, rate) = self.fit(Method::VelocityParabola, latitude).ok()?;
        Some(NoiseOfRate::of(&fit, &rate.coefficients(2), &rate.up, rate.gravity))
    }

    /// Heading and levels at the window's end by one method. `latitude_deg` is needed by all but one, which finds it; its
    /// sign is then that of the vertical rate. `noise` is that of the gyros; `bias_deg_h` the declared one sigma of theirs.
    ///
    /// Errors: too short a window, near a pole, not gravity, no Earth rate above the noise.
    pub fn solve(
        &self,
        method: Method,
        latitude_deg: Option<f64>,
        noise: &NoiseOfRate,
        bias_deg_h: f64,
    ) -> Result<Aligned, AlignError> {
        let length_s = self.seconds;
        let (rate, axes, variance_rad2_s2, level_rad) = if method == Method::StaticMean {
            let rate = self.static_rate(latitude_deg)?;
            // What the base turned in the meantime is taken for a rate: its tilt from the first second to the last.
            let tilt_rad = self.tilt_rad(rate.gravity);
            let of_noise = noise.mean(|n2| n2 / length_s);
            (rate, Quaternion::IDENTITY, of_noise + (tilt_rad / length_s) * (tilt_rad / length_s), tilt_rad)
        } else {
            let (fit, rate) = self.fit(method, latitude_deg)?;
            let of_noise = noise.mean(|n2| fit.slope_variance(n2, rate.gravity));
            let level_rad = libm::sqrt(fit.offset_variance()) / rate.gravity;
            (rate, self.inertial, of_noise, level_rad)
        };
        let horizontal = rate.east.norm() / rate.gravity;
        let excess = if method == Method::UnknownLatitude { 0.0 } else { horizontal - rate.cos * EARTH_RATE_RAD_S };
        let bias = bias_deg_h * RAD_PER_DEG / 3600.0;
        // Across the direction of north nothing shows; along it the Earth's rate is known. What is too much there beyond its
        // noise is a bias, and the other axis may have one of that size.
        let variance = variance_rad2_s2 + bias * bias;
        let variance = variance + (excess * excess - variance).max(0.0);
        let sigma = libm::sqrt(variance);
        let to_deg_h = DEG_PER_RAD * 3600.0;
        if horizontal <= 2.0 * sigma && method != Method::StaticMean {
            return Err(AlignError::NoEarthRate { rate_deg_h: horizontal * to_deg_h, sigma_deg_h: sigma * to_deg_h });
        }
        let geographic = rate.orientation();
        let earth = Vector3::new(0.0, rate.cos, rate.sin) * EARTH_RATE_RAD_S;
        let turned_s = if method == Method::StaticMean { 0.0 } else { length_s };
        let earth = Quaternion::from_rotation_vector(&(earth * turned_s));
        let orientation = earth.inverse().after(&geographic).after(&axes).normalised();
        Ok(Aligned {
            orientation,
            angles: orientation.angles(),
            sigma_heading_deg: (sigma / (rate.cos * EARTH_RATE_RAD_S) * DEG_PER_RAD).min(180.0),
            sigma_level_deg: level_rad * DEG_PER_RAD,
            latitude_deg: libm::atan2(rate.sin, rate.cos) * DEG_PER_RAD,
            rate_excess_deg_h: excess * to_deg_h,
        })
    }

    fn tilt_rad(&self, gravity: f64) -> f64 {
        let end = self.inertial.inverse().rotate(&self.last_force);
        self.first_force.map_or(0.0, |first| (end - first).norm() / gravity)
    }

    fn static_rate(&self, latitude_deg: Option<f64>) -> Result<EarthSeen, AlignError> {
        self.check_length()?;
        let up = self.felt_m_s / self.seconds;
        let gravity = check_gravity(&up)?;
        let up = up / gravity;
        // rate × up = Ω cos φ east, in the units of the slope of specific force.
        let east = (self.angle_rad / self.seconds).cross(&up) * gravity;
        let (sin, cos) = check_latitude(latitude_deg.unwrap_or(f64::NAN))?;
        Ok(EarthSeen { up, gravity, east, sin, cos })
    }

    fn check_length(&self) -> Result<(), AlignError> {
        if self.velocity.count() < LEAST_BLOCKS {
            let least_s = f64::from(LEAST_BLOCKS) * BLOCK_S;
            return Err(AlignError::TooShort { seconds: self.seconds, least_s });
        }
        Ok(())
    }

    /// The Earth as the polynomial sees it, with the terms beyond the one that carries the heading taken out by what is known
    /// of them.
    fn fit(&self, method: Method, latitude_deg: Option<f64>) -> Result<(Fit, EarthSeen), AlignError> {
        self.check_length()?;
        let nominal = self.first_force.unwrap_or_default();
        let (moments, integrations) = if method == Method::ForceLine { (&self.force, 1) } else { (&self.velocity, 2) };
        let too_short = AlignError::TooShort { seconds: self.seconds, least_s: f64::from(LEAST_BLOCKS) * BLOCK_S };
        let fit = moments.fit(integrations).ok_or(too_short)?;
        let known = match method {
            Method::UnknownLatitude => None,
            _ => Some(check_latitude(latitude_deg.unwrap_or(f64::NAN))?),
        };
        let mut beyond = [Vector3::zeros(); COEFFICIENTS];
        let mut seen = EarthSeen::of(&fit, &beyond, &nominal, integrations)?;
        // The terms beyond are of the order of Ωt, 0.02 in 300 s: four rounds bring them to 1e-7 of what they do.
        for _ in 0..4 {
            (seen.sin, seen.cos) = match known {
                Some(known) => known,
                None => self.found_latitude(&seen)?,
            };
            beyond = seen.coefficients(integrations);
            let (sin, cos) = (seen.sin, seen.cos);
            seen = EarthSeen { sin, cos, ..EarthSeen::of(&fit, &beyond, &nominal, integrations)? };
        }
        Ok((fit, seen))
    }

    /// Sine and cosine of the latitude: its size from the horizontal rate, its sign from the gyros' rate about the vertical.
    fn found_latitude(&self, seen: &EarthSeen) -> Result<(f64, f64), AlignError> {
        let cos = (seen.east.norm() / (seen.gravity * EARTH_RATE_RAD_S)).min(1.0);
        if cos < libm::sin(POLE_LIMIT_DEG * RAD_PER_DEG) {
            return Err(AlignError::Latitude(LatitudeError::NearPole));
        }
        Ok((libm::copysign(libm::sqrt(1.0 - cos * cos), self.angle_rad.dot(&seen.up)), cos))
    }
}

/// What is seen of the Earth from the inertial axes.
#[derive(Clone, Copy, Debug)]
struct EarthSeen {
    /// Unit vector at the window's beginning.
    up: Vector3<f64>,
    /// m/s².
    gravity: f64,
    /// Slope of the specific force, g Ω cos φ east, m/s³.
    east: Vector3<f64>,
    /// Of the latitude.
    sin: f64,
    cos: f64,
}

impl EarthSeen {
    /// From the fit, the terms `beyond` taken out. The latitude is filled in by who knows it.
    fn of(
        fit: &Fit,
        beyond: &[Vector3<f64>; COEFFICIENTS],
        nominal: &Vector3<f64>,
        integrations: usize,
    ) -> Result<Self, AlignError> {
        let (constant, slope) = fit.constant_and_slope(beyond);
        let up = nominal + constant;
        let gravity = check_gravity(&up)?;
        let up = up / gravity;
        // t²/2 of the velocity is t of the force.
        let east = slope * if integrations == 2 { 2.0 } else { 1.0 };
        let east = east - up * up.dot(&east);
        Ok(Self { up, gravity, east, sin: 0.0, cos: 1.0 })
    }

    /// East and north, unit vectors.
    fn east_north(&self) -> (Vector3<f64>, Vector3<f64>) {
        let length = self.east.norm();
        let east = if length > 0.0 { self.east / length } else { Vector3::zeros() };
        (east, self.up.cross(&east))
    }

    /// Inertial axes (the block's of the beginning) to east, north, up of the beginning.
    fn orientation(&self) -> Quaternion {
        let (east, north) = self.east_north();
        Quaternion::from_direction_cosines(&Matrix3::from_rows(&[
            east.transpose(),
            north.transpose(),
            self.up.transpose(),
        ]))
    }

    /// Coefficients of t, t², … beyond the one that carries the heading, of the `integrations`-th integral less one: the
    /// series of g [up + cos φ (east sin Ωt + (sin φ north − cos φ up)(1 − cos Ωt))].
    fn coefficients(&self, integrations: usize) -> [Vector3<f64>; COEFFICIENTS] {
        let (east, north) = self.east_north();
        let across = (north * self.sin - self.up * self.cos) * (self.gravity * self.cos);
        let along = east * (self.gravity * self.cos);
        let rate = EARTH_RATE_RAD_S;
        // Of the force: t² … t⁶.
        let force = [
            across * (rate * rate / 2.0),
            along * (-rate * rate * rate / 6.0),
            across * (-rate * rate * rate * rate / 24.0),
            along * (rate * rate * rate * rate * rate / 120.0),
        ];
        let mut out = [Vector3::zeros(); COEFFICIENTS];
        for (power, coefficient) in (2..).zip(force) {
            // An integral of tⁿ is t^(n+1) / (n+1).
            let (to, divisor) = if integrations == 2 { (power + 1, (power + 1) as f64) } else { (power, 1.0) };
            if let Some(place) = out.get_mut(to) {
                *place = coefficient / divisor;
            }
        }
        out
    }
}

fn check_gravity(up: &Vector3<f64>) -> Result<f64, AlignError> {
    let force_m_s2 = up.norm();
    if (9.3..=10.3).contains(&force_m_s2) { Ok(force_m_s2) } else { Err(AlignError::NotGravity { force_m_s2 }) }
}

fn check_latitude(latitude_deg: f64) -> Result<(f64, f64), AlignError> {
    let earth = earth_rate(latitude_deg).map_err(AlignError::Latitude)?;
    Ok((earth.up_deg_h / EARTH_RATE_DEG_H, earth.north_deg_h / EARTH_RATE_DEG_H))
}

#[cfg(test)]
mod tests;

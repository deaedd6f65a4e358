//! Alignment: heading and levels of a block that stands, or sways without going anywhere.
//!
//! The gyros carry the block's axes of the beginning through the window, as if these stood still among the stars. Seen from
//! them the support against gravity turns with the Earth,
//!
//! f(t) = g up + g Ω cos φ east · t + g cos φ (sin φ north − cos φ up) Ω² t²/2 − …,
//!
//! so that its mean is up and its slope points east: heading needs nothing else. The mean of the gyros' rates, which takes the
//! base for still altogether, is the coarse alignment. What disturbs a fit of that slope depends on the base. One that comes back
//! to where it was has white noise in its velocity: a parabola through the integral of f. Accelerometers have it in the
//! force: a line through f. Gyros have it in the rate, and f wanders. With white rate noise of the density N² alone an error of the
//! horizontal rate has the variance N²/T of the mean rate; the line alone makes 6/5 of it, the parabola 10/7. With white force
//! noise of density A² alone the line has 12 A²/g²T³, the parabola 10/7 of it. The least squares that know how much there is of each are
//! [`tracker`]; how much there is, they learn from the window itself and from others of the same recording ([`noise`]): the
//! likelihoods of 720 mixtures are computed and the results averaged over them (Hoeting and others, Bayesian model
//! averaging, Statistical Science 14, 1999). Loud seconds count less ([`blocks`]).

mod blocks;
mod noise;
mod tracker;

use nalgebra::{Matrix3, Vector3};

pub use self::noise::NoiseOfRate;

use self::blocks::{BlockList, Blocks};
use self::noise::{CANDIDATES, Noise, log_sum, probabilities};
use self::tracker::{Tracked, track};
use super::coning::{Algorithm, Increment, Integrator};
use super::quaternion::Quaternion;
use super::rotation::Angles;
use crate::earth::{EARTH_RATE_DEG_H, LatitudeError, POLE_LIMIT_DEG, earth_rate};
use crate::units::{DEG_PER_RAD, RAD_PER_DEG};

/// Ω, rad/s.
const EARTH_RATE_RAD_S: f64 = EARTH_RATE_DEG_H * RAD_PER_DEG / 3600.0;
/// Fewest blocks of velocity, 1 s each: three fill the filter, six judge the noise.
const LEAST_BLOCKS: usize = 9;
const LEAST_S: f64 = LEAST_BLOCKS as f64;
/// Rounds that take out the terms beyond the slope. They are of the order of Ωt, 0.02 in 300 s, of what is found: three rounds
/// bring them to 1e-5 of themselves.
const ROUNDS: usize = 3;
/// A horizontal rate that is so many sigmas from the Earth's is a bias of the gyros.
const BIAS_SIGMAS: f64 = 2.0;
/// Candidates less likely than this are left out: together below 1e-4.
const LEAST_PROBABILITY: f64 = 1e-6;
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
    /// Least squares in inertial axes with the noise that the window shows.
    LeastSquares,
    /// The same where the latitude is not known.
    UnknownLatitude,
}

impl Method {
    /// All, from the coarsest to the finest; the last is for where there is no latitude.
    pub const ALL: [Self; 5] =
        [Self::StaticMean, Self::ForceLine, Self::VelocityParabola, Self::LeastSquares, Self::UnknownLatitude];

    /// Its name, in lower case with hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::StaticMean => "static-mean",
            Self::ForceLine => "inertial-force-line",
            Self::VelocityParabola => "inertial-velocity-parabola",
            Self::LeastSquares => "inertial-least-squares",
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
    blocks: Blocks,
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
            blocks: Blocks::default(),
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
        self.blocks.push(dt_s, &(0.5 * (before + self.velocity_m_s)));
        true
    }

    /// What the window tells of the gyros' noise, to be shared with others of the same recording. `None` where there is too
    /// little to tell.
    pub fn noise(&self, latitude_deg: Option<f64>) -> Option<NoiseOfRate> {
        let method = if latitude_deg.is_some() { Method::LeastSquares } else { Method::UnknownLatitude };
        let window = self.window(method, latitude_deg).ok()?;
        let mut densities = noise::tried();
        let of = |rate: f64| log_sum(&window.likelihoods(rate));
        Some(NoiseOfRate::Learned(core::array::from_fn(|_| densities.next().map_or(f64::NEG_INFINITY, of))))
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
        bias_deg_h: Option<f64>,
    ) -> Result<Aligned, AlignError> {
        let length_s = self.seconds;
        let (rate, axes, variance_rad2_s2, level_rad) = if method == Method::StaticMean {
            let rate = self.static_rate(latitude_deg)?;
            // What the base turned in the meantime is taken for a rate: its tilt from the first second to the last.
            let tilt_rad = self.tilt_rad(rate.gravity);
            let of_noise = noise.mean_density() / length_s;
            (rate, Quaternion::IDENTITY, of_noise + (tilt_rad / length_s) * (tilt_rad / length_s), tilt_rad)
        } else {
            let window = self.window(method, latitude_deg)?;
            let (tracked, slope_variance) = window.average(method, noise);
            let rate = self.seen(&tracked, &window.nominal, window.seen.sin, window.seen.cos)?;
            let g2 = rate.gravity * rate.gravity;
            (rate, self.inertial, slope_variance / g2, libm::sqrt(tracked.force_variance / g2))
        };
        let horizontal = rate.east.norm() / rate.gravity;
        let excess = if method == Method::UnknownLatitude { 0.0 } else { horizontal - rate.cos * EARTH_RATE_RAD_S };
        // Across the direction of north nothing shows; along it the Earth's rate is known. What is too much there beyond its
        // noise is a bias, and the other axis may have one of that size, unless a bias is declared.
        let shown = if libm::fabs(excess) > BIAS_SIGMAS * libm::sqrt(variance_rad2_s2) { excess } else { 0.0 };
        let bias = bias_deg_h.map_or(shown, |declared| declared * RAD_PER_DEG / 3600.0);
        let sigma = libm::sqrt(variance_rad2_s2 + bias * bias);
        let to_deg_h = DEG_PER_RAD * 3600.0;
        // The mean of a base that rocks has any rate: it is refused only where there is hardly one.
        let least = if method == Method::StaticMean { 0.1 * rate.cos * EARTH_RATE_RAD_S } else { 2.0 * sigma };
        if horizontal <= least {
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
        let (first, last) = self.blocks.first_and_last_force().unwrap_or_default();
        (self.inertial.inverse().rotate(&last) - first).norm() / gravity
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
        if self.blocks.count() < LEAST_BLOCKS {
            return Err(AlignError::TooShort { seconds: self.seconds, least_s: LEAST_S });
        }
        Ok(())
    }

    /// The window's velocities without the terms beyond the slope, by what is known of them from the slope.
    fn window(&self, method: Method, latitude_deg: Option<f64>) -> Result<Window, AlignError> {
        self.check_length()?;
        let too_short = AlignError::TooShort { seconds: self.seconds, least_s: LEAST_S };
        let (nominal, _) = self.blocks.first_and_last_force().ok_or(too_short)?;
        let up = nominal / check_gravity(&nominal)?;
        let known = match method {
            Method::UnknownLatitude => None,
            _ => Some(check_latitude(latitude_deg.unwrap_or(f64::NAN))?),
        };
        let blocks = self.blocks.whitened(&up);
        let mut window = Window {
            velocities: blocks.iter().map(|(t_s, velocity)| velocity - nominal * t_s).collect(),
            local_variances: blocks.local_variances(&up),
            mean_variance: blocks.mean_variance(&up),
            step_s: blocks.step_s(),
            nominal,
            seen: EarthSeen { up, gravity: nominal.norm(), east: Vector3::zeros(), sin: 0.0, cos: 1.0 },
        };
        for _ in 0..ROUNDS {
            let tracked = window.track(&Noise::OF_BOTH, &Noise::OF_BOTH);
            let mut seen = self.seen(&tracked, &nominal, window.seen.sin, window.seen.cos)?;
            (seen.sin, seen.cos) = match known {
                Some(known) => known,
                None => self.found_latitude(&seen)?,
            };
            window.seen = seen;
            for ((t_s, velocity), place) in blocks.iter().zip(&mut window.velocities) {
                *place = velocity - nominal * t_s - seen.beyond(t_s);
            }
        }
        Ok(window)
    }

    fn seen(&self, tracked: &Tracked, nominal: &Vector3<f64>, sin: f64, cos: f64) -> Result<EarthSeen, AlignError> {
        let up = nominal + tracked.force;
        let gravity = check_gravity(&up)?;
        let up = up / gravity;
        Ok(EarthSeen { up, gravity, east: tracked.slope - up * up.dot(&tracked.slope), sin, cos })
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

/// Velocities that a line of the force makes.
#[derive(Clone, Debug)]
struct Window {
    /// Without the nominal force and the terms beyond the slope, m/s.
    velocities: BlockList<Vector3<f64>>,
    /// (m/s)².
    local_variances: BlockList<f64>,
    mean_variance: f64,
    step_s: f64,
    /// m/s².
    nominal: Vector3<f64>,
    seen: EarthSeen,
}

impl Window {
    fn track(&self, believed: &Noise, actual: &Noise) -> Tracked {
        let variances = self.local_variances.iter().map(|local| [*local, self.mean_variance]);
        let blocks = self.velocities.iter().copied().zip(variances);
        track(blocks, self.step_s, &self.seen.up, self.seen.gravity, believed, actual)
    }

    /// Log likelihoods of the candidates with a density of the rate's noise.
    fn likelihoods(&self, rate: f64) -> [f64; CANDIDATES] {
        let mut candidates = Noise::candidates(rate);
        let of = |candidate: Noise| self.track(&candidate, &candidate).log_likelihood;
        core::array::from_fn(|_| candidates.next().map_or(f64::NEG_INFINITY, of))
    }

    /// Mean over the candidates, and the variance of its slope along one axis: that of each and the spread between them.
    fn average(&self, method: Method, noise: &NoiseOfRate) -> (Tracked, f64) {
        let believed = match method {
            Method::ForceLine => Some(Noise::OF_FORCE),
            Method::VelocityParabola => Some(Noise::OF_VELOCITY),
            _ => None,
        };
        let across = |slope: &Vector3<f64>| slope - self.seen.up * self.seen.up.dot(slope) - self.seen.east;
        let mut mean = Tracked::default();
        let mut square = 0.0;
        for (rate, probability) in noise.densities().filter(|(_, probability)| *probability > LEAST_PROBABILITY) {
            let likelihoods = self.likelihoods(rate);
            for (candidate, own) in Noise::candidates(rate).zip(probabilities(&likelihoods)) {
                let weight = probability * own;
                if weight > LEAST_PROBABILITY {
                    let tracked = self.track(&believed.unwrap_or(candidate), &candidate);
                    mean.force += tracked.force * weight;
                    mean.slope += tracked.slope * weight;
                    mean.force_variance += tracked.force_variance * weight;
                    mean.slope_variance += tracked.slope_variance * weight;
                    square += weight * across(&tracked.slope).norm_squared();
                }
            }
        }
        let spread = 0.5 * (square - across(&mean.slope).norm_squared()).max(0.0);
        (mean, mean.slope_variance + spread)
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

    /// What the integral of the force has beyond the constant and the slope, m/s: that of
    /// g cos φ [east sin Ωt + (sin φ north − cos φ up)(1 − cos Ωt)] less g cos φ east Ωt²/2.
    fn beyond(&self, t_s: f64) -> Vector3<f64> {
        let (east, north) = self.east_north();
        let turned = EARTH_RATE_RAD_S * t_s;
        let along = (1.0 - libm::cos(turned)) / EARTH_RATE_RAD_S - 0.5 * turned * t_s;
        let across = t_s - libm::sin(turned) / EARTH_RATE_RAD_S;
        (east * along + (north * self.sin - self.up * self.cos) * across) * (self.gravity * self.cos)
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

//! Alignment: heading and levels of a block that stands, or sways without going anywhere.
//!
//! The gyros carry the block's axes of the beginning through the window, as if these stood still among the stars. Seen from
//! them the support against gravity turns with the Earth,
//!
//! f(t) = g up + g Ω cos φ east · t + g cos φ (sin φ north − cos φ up) Ω² t²/2 − …,
//!
//! so that its mean is up and its slope points east: heading needs nothing else. The accelerometers tell that slope whatever the base
//! does, with their noise; the gyros alone tell it, without any, where the base stands: the mean of their rates. How the base moves is
//! therefore a parameter: jitter (white attitude), a random walk and a steady drift. With white rate noise of the density N² alone an
//! error of the horizontal rate has the variance N²/T where the base stands, and 6/5 of it where it turns as it likes and the
//! accelerometers have no noise; white force noise of density A² adds 12 A²/g²T³ there, a base that comes back to where it was has
//! white noise in its velocity. The least squares that know how much there is of each are `tracker`; how much there is, they learn
//! from the window itself and from others of the same recording (`noise`): likelihoods of all mixtures are computed and the
//! results averaged over them (Hoeting and others, Bayesian model averaging, Statistical Science 14, 1999). Loud seconds count less
//! (`blocks`).

mod blocks;
mod noise;
mod tracker;

use nalgebra::{Matrix3, Vector3};
use quantities::earth::{EARTH_RATE_DEG_H, LatitudeError, POLE_LIMIT_DEG, earth_rate};
use quantities::units::{ARCSEC_PER_RAD, DEG_PER_RAD, RAD_PER_DEG};

pub use self::noise::NoiseOfRate;

use self::blocks::{BlockList, Blocks, local_variances, mean_variance};
use self::noise::{BASES, Base, CANDIDATES, Noise, log_sum};
use self::tracker::{Measured, Tracked, track};
use super::coning::{Algorithm, Increment, Integrator, LONGEST_SAMPLE_S};
use super::quaternion::Quaternion;
use super::rotation::Angles;

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
/// The latitude that the rates give is so many sigmas from the given one where it contradicts it …
const LATITUDE_SIGMAS: f64 = 5.0;
/// … and so many degrees beside: of a latitude that is given to a degree the vertical rate is wrong by 0.26 °/h at the most, which
/// turns the heading by 0.02° in 600 s.
const LATITUDE_GIVEN_DEG: f64 = 1.0;
/// Over T² and times the variance about its line, the variance of a random walk's slope: that is 6q/5T, and that about the line qT/15.
const SLOPE_OF_WALK: f64 = 18.0;
/// Models less likely than this are left out: together below 3e-3.
const LEAST_PROBABILITY: f64 = 1e-6;
/// Mixtures of the base's velocity and force that are tried with every base: the likeliest ones. A mixture that is left out is less
/// likely than all of these; what is common to them all is the window's.
const MIXTURES: usize = 2;
/// The accelerometers alone differ from the mean of the models by a drift of the base that is too small to be likely. The square of
/// the difference, per axis and over its variance, is exponential with the mean 1 where there is none: beyond this, in 5 % of the
/// windows of a base that stands, what is beyond counts in sigma.
const CONTRADICTION: f64 = 3.0;

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
    pub base: BaseMotion,
}

/// What the base did meanwhile, one sigma of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseMotion {
    /// Attitude to and fro, from block to block, arcsec.
    pub jitter_arcsec: f64,
    /// Random walk of its attitude, arcsec/√s.
    pub walk_arcsec_sqrt_s: f64,
    /// Steady drift of its attitude, °/h.
    pub drift_deg_h: f64,
    /// What the accelerometers alone, who tell a drift from the Earth's rate, tell it to, °/h. Lesser drifts are not seen: they turn the heading by
    /// their ratio to the horizontal Earth rate, and are in sigma only as far as they are likely beforehand.
    pub unseen_drift_deg_h: f64,
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
    /// The rates are those of the Earth at another latitude, degrees.
    OtherLatitude {
        given_deg: f64,
        found_deg: f64,
        sigma_deg: f64,
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
            Self::OtherLatitude { given_deg, found_deg, sigma_deg } => write!(
                f,
                "the gyros measure the Earth's rotation at latitude {found_deg:+.2}° ± {sigma_deg:.2}°, not at the given {given_deg}°"
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
    /// Turn from the axes of the beginning as a rotation vector.
    turn_rad: Vector3<f64>,
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
            turn_rad: Vector3::zeros(),
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

    /// A sample of `dt_s`, up to [`LONGEST_SAMPLE_S`]; others are left out (`false`), as are numbers that are none.
    pub fn push(&mut self, dt_s: f64, sample: Increment) -> bool {
        let finite = sample.angle_rad.iter().chain(sample.velocity_m_s.iter()).all(|part| part.is_finite());
        if !(finite && dt_s > 0.0 && dt_s <= LONGEST_SAMPLE_S) {
            return false;
        }
        let Some(interval) = self.integrator.push(sample) else { return true };
        let before = (self.velocity_m_s, self.turn_rad);
        self.velocity_m_s += self.inertial.rotate(&interval.velocity_m_s);
        self.inertial = self.inertial.advance(&interval.angle_rad, &Vector3::zeros());
        self.turn_rad = self.inertial.rotation_vector();
        self.seconds += dt_s;
        self.felt_m_s += sample.velocity_m_s;
        // A trapezium: the means over the sample.
        let (velocity, turn) = (before.0 + self.velocity_m_s, before.1 + self.turn_rad);
        self.blocks.push(dt_s, &(0.5 * velocity), &(0.5 * turn));
        true
    }

    /// What the window tells of the gyros' noise, to be shared with others of the same recording. `None` where there is too
    /// little to tell.
    pub fn noise(&self, latitude_deg: Option<f64>) -> Option<NoiseOfRate> {
        let window = self.window(latitude_deg).ok()?;
        let mut densities = noise::tried();
        let of = |rate: f64| window.models(rate).log_evidence();
        Some(NoiseOfRate::Learned(core::array::from_fn(|_| densities.next().map_or(f64::NEG_INFINITY, of))))
    }

    /// Heading and levels at the window's end. Without a latitude it is found; its sign is then that of the vertical rate. `noise`
    /// is that of the gyros; `bias_deg_h` the declared one sigma of theirs, and 0 leaves every bias out of sigma.
    ///
    /// Errors: too short a window, near a pole, not gravity, rates of another latitude, no Earth rate above the noise.
    pub fn solve(
        &self,
        latitude_deg: Option<f64>,
        noise: &NoiseOfRate,
        bias_deg_h: Option<f64>,
    ) -> Result<Aligned, AlignError> {
        let window = self.window(latitude_deg)?;
        let average = window.average(noise);
        let rate = self.seen(&average.tracked, &window.nominal, window.seen.sin, window.seen.cos)?;
        let g2 = rate.gravity * rate.gravity;
        let variance_rad2_s2 = average.tracked.slope_variance / g2;
        let horizontal = rate.east.norm() / rate.gravity;
        let declared = bias_deg_h.unwrap_or(0.0) * RAD_PER_DEG / 3600.0;
        if let Some(given_deg) = latitude_deg {
            self.check_rates(given_deg, horizontal, &rate.up, variance_rad2_s2, declared)?;
        }
        let excess = if latitude_deg.is_none() { 0.0 } else { horizontal - rate.cos * EARTH_RATE_RAD_S };
        // Across the direction of north nothing shows; along it the Earth's rate is known. What is too much there beyond its
        // noise and the declared bias is a bias, and the other axis may have one of that size.
        let explained = BIAS_SIGMAS * libm::sqrt(variance_rad2_s2 + declared * declared);
        let shows = bias_deg_h != Some(0.0) && libm::fabs(excess) > explained;
        let bias = if shows { excess } else { declared };
        let sigma = libm::sqrt(variance_rad2_s2 + bias * bias);
        let to_deg_h = DEG_PER_RAD * 3600.0;
        if horizontal <= 2.0 * sigma {
            return Err(AlignError::NoEarthRate { rate_deg_h: horizontal * to_deg_h, sigma_deg_h: sigma * to_deg_h });
        }
        let earth = Vector3::new(0.0, rate.cos, rate.sin) * EARTH_RATE_RAD_S;
        let earth = Quaternion::from_rotation_vector(&(earth * self.seconds));
        let orientation = earth.inverse().after(&rate.orientation()).after(&self.inertial).normalised();
        Ok(Aligned {
            orientation,
            angles: orientation.angles(),
            sigma_heading_deg: (sigma / (rate.cos * EARTH_RATE_RAD_S) * DEG_PER_RAD).min(180.0),
            sigma_level_deg: libm::sqrt(average.tracked.force_variance / g2) * DEG_PER_RAD,
            latitude_deg: libm::atan2(rate.sin, rate.cos) * DEG_PER_RAD,
            rate_excess_deg_h: excess * to_deg_h,
            base: BaseMotion {
                jitter_arcsec: libm::sqrt(window.jitter_variance / g2) * ARCSEC_PER_RAD,
                walk_arcsec_sqrt_s: libm::sqrt(average.base.walk_rad2_s) * ARCSEC_PER_RAD,
                drift_deg_h: average.base.drift_rad_s * to_deg_h,
                unseen_drift_deg_h: libm::sqrt(average.free_variance / g2) * to_deg_h,
            },
        })
    }

    /// Whether the rates contradict the latitude: horizontal rate, rad/s, with its variance by noise, and bias of the gyros, one sigma,
    /// rad/s. What both rates together have beyond the Earth's is a bias, too, or the base's own turn, of which no latitude follows.
    fn check_rates(
        &self,
        given_deg: f64,
        horizontal: f64,
        up: &Vector3<f64>,
        variance: f64,
        bias: f64,
    ) -> Result<(), AlignError> {
        let (vertical, turned) = self.vertical_rate(up);
        let whole = libm::hypot(horizontal, vertical);
        let beyond = whole - EARTH_RATE_RAD_S;
        let biases = bias * bias + beyond * beyond;
        let (sin, cos) = (vertical / whole, horizontal / whole);
        let across = sin * sin * variance + cos * cos * (variance + turned) + biases;
        let (found_deg, sigma_deg) = (libm::atan2(sin, cos) * DEG_PER_RAD, libm::sqrt(across) / whole * DEG_PER_RAD);
        if libm::fabs(found_deg - given_deg) > LATITUDE_GIVEN_DEG + LATITUDE_SIGMAS * sigma_deg {
            return Err(AlignError::OtherLatitude { given_deg, found_deg, sigma_deg });
        }
        Ok(())
    }

    /// Slope of the least squares line through the turn about the vertical, rad/s, and its variance, as if the turn about the line
    /// were a random walk: a sway that returns to where it was has less.
    fn vertical_rate(&self, up: &Vector3<f64>) -> (f64, f64) {
        let turns = || self.blocks.iter().map(|(t_s, _, turn)| (t_s, turn.dot(up)));
        let count = self.blocks.count() as f64;
        let (t_sum, turn_sum) = turns().fold((0.0, 0.0), |(a, b), (t_s, turn)| (a + t_s, b + turn));
        let (t_mean, turn_mean) = (t_sum / count, turn_sum / count);
        let (square, product) = turns().fold((0.0, 0.0), |(square, product), (t_s, turn)| {
            let t_s = t_s - t_mean;
            (square + t_s * t_s, product + t_s * (turn - turn_mean))
        });
        let rate = product / square;
        let residual = |(t_s, turn): (f64, f64)| turn - turn_mean - rate * (t_s - t_mean);
        let about = turns().map(|at| residual(at) * residual(at)).sum::<f64>() / count;
        let whole_s = count * self.blocks.step_s();
        (rate, SLOPE_OF_WALK * about / (whole_s * whole_s))
    }

    fn check_length(&self) -> Result<(), AlignError> {
        if self.blocks.count() < LEAST_BLOCKS {
            return Err(AlignError::TooShort { seconds: self.seconds, least_s: LEAST_S });
        }
        Ok(())
    }

    /// The window's blocks without the terms beyond the slope, by what is known of them from the slope.
    fn window(&self, latitude_deg: Option<f64>) -> Result<Window, AlignError> {
        self.check_length()?;
        let too_short = AlignError::TooShort { seconds: self.seconds, least_s: LEAST_S };
        let nominal = self.blocks.first_force().ok_or(too_short)?;
        let gravity = check_gravity(&nominal)?;
        let up = nominal / gravity;
        // Where the gyros would see the support of a base that stands: its mean in the block's axes is known best.
        let felt = self.felt_m_s.normalize() * gravity;
        let known = latitude_deg.map(check_latitude).transpose()?;
        let blocks = self.blocks.whitened(&up);
        let velocities = blocks.iter().map(|(t_s, velocity, _)| velocity - nominal * t_s).collect();
        let supports =
            blocks.iter().map(|(.., turn)| Quaternion::from_rotation_vector(&turn).rotate(&felt) - nominal).collect();
        let (velocity_mean, support_mean) = (mean_variance(&velocities, &up), mean_variance(&supports, &up));
        let (velocity_local, support_local) = (local_variances(&velocities, &up), local_variances(&supports, &up));
        let means = velocities.iter().zip(&supports);
        let measured =
            means.zip(velocity_local.iter().zip(&support_local)).map(|((velocity, support), (v, s))| Measured {
                velocity: *velocity,
                support: *support,
                velocity_variance: [*v, velocity_mean],
                support_variance: [*s, support_mean],
            });
        let mut window = Window {
            blocks: measured.collect(),
            step_s: blocks.step_s(),
            nominal,
            jitter_variance: support_mean,
            seen: EarthSeen { up, gravity, east: Vector3::zeros(), sin: 0.0, cos: 1.0 },
        };
        for _ in 0..ROUNDS {
            let tracked = window.track(&Noise::OF_BOTH, &Base::FREE);
            let mut seen = self.seen(&tracked, &nominal, window.seen.sin, window.seen.cos)?;
            (seen.sin, seen.cos) = match known {
                Some(known) => known,
                None => self.found_latitude(&seen)?,
            };
            window.seen = seen;
            let half_s = 0.5 * window.step_s;
            let whole = velocities.iter().zip(&supports).zip(blocks.iter());
            for (place, ((velocity, support), (t_s, ..))) in window.blocks.iter_mut().zip(whole) {
                place.velocity = velocity - seen.beyond(t_s);
                place.support = support - (seen.beyond(t_s + half_s) - seen.beyond(t_s - half_s)) / window.step_s;
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
        Ok((libm::copysign(libm::sqrt(1.0 - cos * cos), self.turn_rad.dot(&seen.up)), cos))
    }
}

/// A window without the nominal force and the terms beyond the slope.
#[derive(Clone, Debug)]
struct Window {
    blocks: BlockList<Measured>,
    step_s: f64,
    /// m/s².
    nominal: Vector3<f64>,
    /// Of the base's attitude times g, (m/s²)².
    jitter_variance: f64,
    seen: EarthSeen,
}

impl Window {
    fn track(&self, noise: &Noise, base: &Base) -> Tracked {
        track(self.blocks.iter(), self.step_s, &self.seen.up, self.seen.gravity, noise, base)
    }

    /// Every base with the likeliest mixtures, at one density of the rate's noise. How likely a mixture is the accelerometers tell
    /// while the base is free.
    fn models(&self, rate: f64) -> Models {
        let mut free: heapless::Vec<(f64, Noise), CANDIDATES> =
            Noise::candidates(rate).map(|noise| (self.track(&noise, &Base::FREE).log_likelihood, noise)).collect();
        free.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let alone = free.first().map_or_else(Tracked::default, |(_, noise)| self.track(noise, &Base::FREE));
        let kept = free.iter().take(MIXTURES);
        let models = kept.flat_map(|(_, noise)| {
            Base::all(rate).map(|(base, prior)| {
                let tracked = self.track(noise, &base);
                (tracked.log_likelihood + prior, base, tracked)
            })
        });
        Models { weighed: models.collect(), free: alone }
    }

    /// Mean over all models; the variance of its slope along one axis is the mean of theirs and the spread between them, and what
    /// the accelerometers alone contradict it by.
    fn average(&self, noise: &NoiseOfRate) -> Average {
        let across = |slope: &Vector3<f64>| slope - self.seen.up * self.seen.up.dot(slope) - self.seen.east;
        let (mut mean, mut free) = (Tracked::default(), Tracked::default());
        let (mut square, mut base) = (0.0, Base::default());
        for (rate, probability) in noise.densities().filter(|(_, probability)| *probability > LEAST_PROBABILITY) {
            let models = self.models(rate);
            let evidence = models.log_evidence();
            free.slope += models.free.slope * probability;
            free.slope_variance += models.free.slope_variance * probability;
            for (log, moved, tracked) in &models.weighed {
                let weight = probability * libm::exp(log - evidence);
                if weight > LEAST_PROBABILITY {
                    mean.force += tracked.force * weight;
                    mean.slope += tracked.slope * weight;
                    mean.force_variance += tracked.force_variance * weight;
                    mean.slope_variance += tracked.slope_variance * weight;
                    square += weight * across(&tracked.slope).norm_squared();
                    base.walk_rad2_s += weight * moved.walk_rad2_s;
                    base.drift_rad_s += weight * moved.drift_rad_s * moved.drift_rad_s;
                }
            }
        }
        base.drift_rad_s = libm::sqrt(base.drift_rad_s);
        mean.slope_variance += 0.5 * (square - across(&mean.slope).norm_squared()).max(0.0);
        let apart = 0.5 * (across(&mean.slope) - across(&free.slope)).norm_squared();
        let allowed = CONTRADICTION * (free.slope_variance - mean.slope_variance).max(0.0);
        mean.slope_variance += (apart - allowed).max(0.0);
        Average { tracked: mean, base, free_variance: free.slope_variance }
    }
}

struct Models {
    /// Log of each model's likelihood times its probability beforehand, its base, and what the window gives by it.
    weighed: heapless::Vec<(f64, Base, Tracked), { MIXTURES * BASES }>,
    /// What the accelerometers alone give, whatever the base does.
    free: Tracked,
}

impl Models {
    fn log_evidence(&self) -> f64 {
        log_sum(self.weighed.iter().map(|(log, ..)| *log))
    }
}

/// The mean of all models, and the root mean square motion of their bases.
struct Average {
    tracked: Tracked,
    base: Base,
    /// Of the slope along one axis by the accelerometers alone, (m/s³)².
    free_variance: f64,
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

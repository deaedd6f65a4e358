//! Heading hold: the block carries the heading of a fix while the instrument is moved.
//!
//! State: small attitude error φ in geographic axes (rad, estimate = (1 + φ ×) truth) and what the gyros' biases are beyond
//! their estimate, δb, in block axes (rad/s), with a covariance of 6 × 6 carried a second at a time: φ grows by C δb dt and by the gyros' white
//! noise, δb is a constant of the run plus a Gauss-Markov process. While the instrument stands, its rate is the Earth's:
//! the second's mean rate is a measurement of the bias, gravity one of the levels, and the orientation does not change but
//! for the creep that is allowed. What a standing base turns more slowly than the bias is known is not felt: that is what the
//! creep is for.
//!
//! Sigma grows with the class of the block ([`BlockClass`]); when it passes its limit a fix is asked for.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::coning::{Algorithm, Increment, Integrator};
use super::quaternion::Quaternion;
use super::rotation::{Angles, cross_matrix};
use crate::earth::{EarthRate, LatitudeError, earth_rate};
use crate::units::{DEG_PER_RAD, RAD_PER_DEG};

/// °/h in rad/s.
const RAD_S_PER_DEG_H: f64 = RAD_PER_DEG / 3600.0;
/// Length of the steps of the covariance, s.
const SECOND_S: f64 = 1.0;
/// A mean rate that is so many sigmas from standing is a motion.
const MOTION_SIGMAS: f64 = 5.0;
/// Accelerometers move when the norm leaves gravity by so much, m/s².
const MOTION_M_S2: f64 = 0.5;
/// Nominal gravity, m/s²: of the levels, where 0.5 % do not matter.
const GRAVITY_M_S2: f64 = 9.8;

/// What a block is good for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockClass {
    pub name: &'static str,
    /// Angle random walk, °/√h.
    pub arw_deg_sqrt_h: f64,
    /// Bias from run to run, °/h, one sigma.
    pub run_to_run_deg_h: f64,
    /// Gauss-Markov part of the bias, °/h, one sigma, and its time constant, s.
    pub markov_deg_h: f64,
    pub markov_s: f64,
    /// Scale factor, one sigma, parts per million.
    pub scale_ppm: f64,
    /// Misalignment of the axes, one sigma, arcsec.
    pub misalignment_arcsec: f64,
    /// Bias of the accelerometers, m/s², one sigma.
    pub accelerometer_m_s2: f64,
    /// Velocity random walk of the accelerometers, m/s/√s.
    pub vrw_m_s_sqrt_s: f64,
    /// A gyro that turns faster, °/s, is saturated.
    pub range_deg_s: f64,
}

impl BlockClass {
    /// The MEMS block of the published system: 0.1 °/s, 0.07 °/s/√Hz (4.2 °/√h); 0.03 m/s², 0.02 m/s²/√Hz.
    pub const SOURCE_MEMS: Self = Self {
        name: "source-mems",
        arw_deg_sqrt_h: 4.2,
        run_to_run_deg_h: 360.0,
        markov_deg_h: 30.0,
        markov_s: 600.0,
        scale_ppm: 3000.0,
        misalignment_arcsec: 200.0,
        accelerometer_m_s2: 0.03,
        vrw_m_s_sqrt_s: 0.02,
        range_deg_s: 300.0,
    };
    /// A modern MEMS unit, Sensonor STIM300, data sheet TS1524 rev. 24: 0.15 °/√h, bias instability 0.5 °/h, 10 °/h over
    /// temperature gradients, scale 500 ppm, misalignment 1 mrad, accelerometer 0.75 mg on/off, 0.06 m/s/√h, 400 °/s.
    pub const MODERN_MEMS: Self = Self {
        name: "modern-mems",
        arw_deg_sqrt_h: 0.15,
        run_to_run_deg_h: 10.0,
        markov_deg_h: 0.5,
        markov_s: 600.0,
        scale_ppm: 500.0,
        misalignment_arcsec: 206.0,
        accelerometer_m_s2: 0.0075,
        vrw_m_s_sqrt_s: 0.001,
        range_deg_s: 400.0,
    };
    /// The fibre-optic block of the published system: 3 °/h, Markov 1 °/h of 600 s, 20 °/h at 0.1 s (0.105 °/√h), 0.3 %, 10″.
    pub const SOURCE_FOG: Self = Self {
        name: "source-fog",
        arw_deg_sqrt_h: 0.105,
        run_to_run_deg_h: 3.0,
        markov_deg_h: 1.0,
        markov_s: 600.0,
        scale_ppm: 3000.0,
        misalignment_arcsec: 10.0,
        accelerometer_m_s2: 0.005,
        vrw_m_s_sqrt_s: 0.0005,
        range_deg_s: 150.0,
    };
    /// A ring-laser block of navigation grade.
    pub const RING_LASER: Self = Self {
        name: "ring-laser",
        arw_deg_sqrt_h: 0.002,
        run_to_run_deg_h: 0.01,
        markov_deg_h: 0.003,
        markov_s: 600.0,
        scale_ppm: 10.0,
        misalignment_arcsec: 5.0,
        accelerometer_m_s2: 0.0005,
        vrw_m_s_sqrt_s: 0.0001,
        range_deg_s: 400.0,
    };
    /// All classes.
    pub const ALL: [Self; 4] = [Self::SOURCE_MEMS, Self::MODERN_MEMS, Self::SOURCE_FOG, Self::RING_LASER];
}

/// What may be asked of a hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldLimits {
    /// Beyond this one sigma of the heading a fix is asked for, degrees.
    pub refix_deg: f64,
    /// What a base that stands may turn unfelt, arcsec/√s.
    pub creep_arcsec_sqrt_s: f64,
    /// Rates of a base that stands but sways: one sigma of a second's mean, °/h.
    pub sway_deg_h: f64,
}

impl Default for HoldLimits {
    fn default() -> Self {
        Self { refix_deg: 0.5, creep_arcsec_sqrt_s: 0.1, sway_deg_h: 2.0 }
    }
}

/// What the base did in a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// It stood: bias and levels were measured.
    Standing,
    /// It moved: increments were summed up.
    Moving,
    /// Samples were missing: heading taken on, sigma widened.
    Bridged,
}

/// Heading and its sigma at the end of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldSecond {
    pub angles: Angles,
    pub sigma_heading_deg: f64,
    pub sigma_level_deg: f64,
    pub motion: Motion,
    /// Sigma has passed its limit: the heading wants a new fix.
    pub refix: bool,
}

/// What was discarded or repaired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HoldCounters {
    /// Samples with numbers that are none, or a length that is none.
    pub invalid: u32,
    /// Samples at or beyond the gyros' range.
    pub saturated: u32,
    /// Gaps that were bridged.
    pub gaps: u32,
}

type Covariance = SMatrix<f64, 6, 6>;

/// A heading that is held.
#[derive(Clone, Debug)]
pub struct Hold {
    class: BlockClass,
    limits: HoldLimits,
    /// Of the Earth in east, north, up, rad/s.
    earth_rad_s: Vector3<f64>,
    orientation: Quaternion,
    /// Estimated, rad/s.
    bias_rad_s: Vector3<f64>,
    covariance: Covariance,
    /// Rotation that was summed up while it moved, rad: what errors of scale and axes have acted on. They are constants, so that a
    /// turn back takes away what the turn brought.
    turned_rad: Vector3<f64>,
    second: Second,
    counters: HoldCounters,
}

/// A second in the making.
#[derive(Clone, Debug)]
struct Second {
    integrator: Integrator,
    /// Orientation carried along; taken over if the instrument moved.
    orientation: Quaternion,
    seconds: f64,
    angle_rad: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    /// Largest departure of the specific force's norm from gravity, m/s².
    shaken_m_s2: f64,
    saturated_rad: f64,
}

impl Second {
    fn new(orientation: Quaternion) -> Self {
        Self {
            integrator: Integrator::new(Algorithm::PreviousInterval),
            orientation,
            seconds: 0.0,
            angle_rad: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
            shaken_m_s2: 0.0,
            saturated_rad: 0.0,
        }
    }
}

impl Hold {
    /// From a fix: orientation of the block with the sigmas of its heading and of its levels, degrees. The instrument stands.
    ///
    /// Errors: no latitude, or one near a pole.
    pub fn new(
        class: &BlockClass,
        limits: HoldLimits,
        latitude_deg: f64,
        angles: &Angles,
        sigma_heading_deg: f64,
        sigma_level_deg: f64,
    ) -> Result<Self, LatitudeError> {
        let EarthRate { north_deg_h, up_deg_h } = earth_rate(latitude_deg)?;
        let orientation = Quaternion::from_angles(angles);
        let level = square(sigma_level_deg * RAD_PER_DEG);
        let bias = square(class.run_to_run_deg_h * RAD_S_PER_DEG_H) + square(class.markov_deg_h * RAD_S_PER_DEG_H);
        let heading = square(sigma_heading_deg * RAD_PER_DEG);
        let diagonal = SVector::<f64, 6>::from([level, level, heading, bias, bias, bias]);
        Ok(Self {
            class: *class,
            limits,
            earth_rad_s: Vector3::new(0.0, north_deg_h, up_deg_h) * RAD_S_PER_DEG_H,
            orientation,
            bias_rad_s: Vector3::zeros(),
            covariance: Covariance::from_diagonal(&diagonal),
            turned_rad: Vector3::zeros(),
            second: Second::new(orientation),
            counters: HoldCounters::default(),
        })
    }

    pub fn counters(&self) -> HoldCounters {
        self.counters
    }

    /// Block axes to geographic ones at the end of the last sample.
    pub fn orientation(&self) -> Quaternion {
        self.second.orientation
    }

    /// Estimated biases of the gyros, °/h.
    pub fn bias_deg_h(&self) -> [f64; 3] {
        (self.bias_rad_s / RAD_S_PER_DEG_H).into()
    }

    /// A sample of `dt_s` seconds. At the end of a second: what became of it.
    pub fn push(&mut self, dt_s: f64, sample: Increment) -> Option<HoldSecond> {
        let finite = sample.angle_rad.iter().chain(sample.velocity_m_s.iter()).all(|part| part.is_finite());
        if !(finite && dt_s > 0.0 && dt_s <= SECOND_S) {
            self.counters.invalid = self.counters.invalid.saturating_add(1);
            return None;
        }
        let range_rad = self.class.range_deg_s * RAD_PER_DEG * dt_s;
        let second = &mut self.second;
        if sample.angle_rad.amax() >= range_rad {
            self.counters.saturated = self.counters.saturated.saturating_add(1);
            // It may have been twice as fast.
            second.saturated_rad += range_rad;
        }
        let corrected = Increment { angle_rad: sample.angle_rad - self.bias_rad_s * dt_s, ..sample };
        if let Some(interval) = second.integrator.push(corrected) {
            second.orientation = second.orientation.advance(&interval.angle_rad, &(self.earth_rad_s * dt_s));
        }
        second.seconds += dt_s;
        second.angle_rad += sample.angle_rad;
        second.velocity_m_s += sample.velocity_m_s;
        let shaken_m_s2 = libm::fabs((sample.velocity_m_s / dt_s).norm() - GRAVITY_M_S2);
        let noise_m_s2 = MOTION_SIGMAS * self.class.vrw_m_s_sqrt_s / libm::sqrt(dt_s);
        second.shaken_m_s2 = second.shaken_m_s2.max(shaken_m_s2 - noise_m_s2);
        (second.seconds >= SECOND_S - 0.5 * dt_s).then(|| self.end_second())
    }

    /// Samples are missing for `gap_s`, in which the instrument may have turned at up to `rate_deg_s`: the heading is taken
    /// on and its sigma widened.
    pub fn bridge(&mut self, gap_s: f64, rate_deg_s: f64) -> HoldSecond {
        self.counters.gaps = self.counters.gaps.saturating_add(1);
        if self.second.seconds > 0.0 {
            self.end_second();
        }
        let turned = square(rate_deg_s * gap_s * RAD_PER_DEG);
        self.propagate(gap_s, turned);
        self.report(Motion::Bridged)
    }

    fn end_second(&mut self) -> HoldSecond {
        let second = core::mem::replace(&mut self.second, Second::new(self.orientation));
        let dt_s = second.seconds;
        let c = self.orientation.direction_cosines();
        // What the gyros read beyond the Earth, the base taken for standing.
        let innovation = second.angle_rad / dt_s - self.bias_rad_s - c.transpose() * self.earth_rad_s;
        let arw = self.class.arw_deg_sqrt_h * RAD_PER_DEG / 60.0;
        let noise = arw * arw / dt_s + square(self.limits.sway_deg_h * RAD_S_PER_DEG_H);
        let stands = second.shaken_m_s2 < MOTION_M_S2
            && second.saturated_rad == 0.0
            && innovation.iter().enumerate().all(|(axis, rate)| {
                let known = self.covariance.get((3 + axis, 3 + axis)).copied().unwrap_or(0.0);
                libm::fabs(*rate) < MOTION_SIGMAS * libm::sqrt(known + noise)
            });
        if stands {
            self.stand(&innovation, noise, &(second.velocity_m_s / dt_s), dt_s);
            self.second = Second::new(self.orientation);
            return self.report(Motion::Standing);
        }
        self.orientation = second.orientation;
        self.second = Second::new(self.orientation);
        self.turned_rad += c * second.angle_rad;
        self.propagate(dt_s, square(second.saturated_rad));
        self.report(Motion::Moving)
    }

    /// The covariance over a motion of `dt_s`, with a further variance of each attitude angle, rad².
    fn propagate(&mut self, dt_s: f64, turned_rad2: f64) {
        let arw = self.class.arw_deg_sqrt_h * RAD_PER_DEG / 60.0;
        let mut transition = Covariance::identity();
        transition
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(Matrix3::identity() - cross_matrix(&(self.earth_rad_s * dt_s))));
        transition.fixed_view_mut::<3, 3>(0, 3).copy_from(&(self.orientation.direction_cosines() * dt_s));
        let attitude = Matrix3::from_diagonal_element(arw * arw * dt_s + turned_rad2);
        self.covariance = transition * self.covariance * transition.transpose() + self.bias_noise(dt_s);
        let mut corner = self.covariance.fixed_view_mut::<3, 3>(0, 0);
        corner += attitude;
    }

    /// Growth of the biases' variance: that of a Gauss-Markov process, taken for a random walk over the second.
    fn bias_noise(&self, dt_s: f64) -> Covariance {
        let walk = 2.0 * square(self.class.markov_deg_h * RAD_S_PER_DEG_H) * dt_s / self.class.markov_s;
        Covariance::from_diagonal(&SVector::<f64, 6>::from([0.0, 0.0, 0.0, walk, walk, walk]))
    }

    /// A second of standing: biases from the rates, levels from gravity, the heading as it was.
    fn stand(&mut self, innovation: &Vector3<f64>, rate_variance: f64, force_m_s2: &Vector3<f64>, dt_s: f64) {
        let creep = square(self.limits.creep_arcsec_sqrt_s * RAD_PER_DEG / 3600.0) * dt_s;
        let creep = Covariance::from_diagonal(&SVector::<f64, 6>::from([creep, creep, creep, 0.0, 0.0, 0.0]));
        self.covariance += self.bias_noise(dt_s) + creep;
        // The Earth is seen along axes that are a little off: that is no bias.
        let c = self.orientation.direction_cosines();
        let seen = -c.transpose() * cross_matrix(&self.earth_rad_s);
        for (axis, rate) in innovation.iter().enumerate() {
            let mut row = SMatrix::<f64, 1, 6>::zeros();
            row.fixed_view_mut::<1, 3>(0, 0).copy_from(&seen.row(axis));
            if let Some(place) = row.get_mut((0, 3 + axis)) {
                *place = 1.0;
            }
            self.update(&row, *rate, rate_variance);
        }
        // Estimated axes: support is (1 + φ ×) up, so that its east part is φ north and its north part −φ east. The bias of
        // the accelerometers does not average out: the variance is not allowed below it.
        let felt = self.orientation.rotate(force_m_s2) / GRAVITY_M_S2;
        let bias = square(self.class.accelerometer_m_s2 / GRAVITY_M_S2);
        let noise = square(self.class.vrw_m_s_sqrt_s / GRAVITY_M_S2) / dt_s;
        for (axis, sign, measured) in [(1, 1.0, felt.x), (0, -1.0, felt.y)] {
            let variance = self.covariance.get((axis, axis)).copied().unwrap_or(0.0);
            if variance > bias {
                let mut row = SMatrix::<f64, 1, 6>::zeros();
                if let Some(place) = row.get_mut((0, axis)) {
                    *place = sign;
                }
                self.update(&row, measured, bias * variance / (variance - bias) + noise);
            }
        }
    }

    /// A scalar measurement of the error state, fed back; Joseph's form keeps the covariance positive.
    fn update(&mut self, row: &SMatrix<f64, 1, 6>, measured: f64, variance: f64) {
        let cross = self.covariance * row.transpose();
        let total = (row * cross).x + variance;
        let gain = cross / total;
        let keep = Covariance::identity() - gain * row;
        self.covariance = keep * self.covariance * keep.transpose() + gain * gain.transpose() * variance;
        let error = gain * measured;
        let attitude: Vector3<f64> = error.fixed_rows::<3>(0).into();
        let bias: Vector3<f64> = error.fixed_rows::<3>(3).into();
        self.orientation = Quaternion::from_rotation_vector(&-attitude).after(&self.orientation).normalised();
        self.bias_rad_s += bias;
    }

    fn report(&self, motion: Motion) -> HoldSecond {
        let BlockClass { scale_ppm, misalignment_arcsec, .. } = self.class;
        let per_rad2 = square(scale_ppm * 1e-6) + square(misalignment_arcsec * RAD_PER_DEG / 3600.0);
        let of_turns = per_rad2 * self.turned_rad.norm_squared();
        let variance = |axis: usize| self.covariance.get((axis, axis)).copied().unwrap_or(f64::INFINITY) + of_turns;
        let sigma_heading_deg = (libm::sqrt(variance(2)) * DEG_PER_RAD).min(180.0);
        HoldSecond {
            angles: self.orientation.angles(),
            sigma_heading_deg,
            sigma_level_deg: libm::sqrt(variance(0).max(variance(1))) * DEG_PER_RAD,
            motion,
            refix: sigma_heading_deg > self.limits.refix_deg,
        }
    }
}

fn square(value: f64) -> f64 {
    value * value
}

#[cfg(test)]
mod tests;

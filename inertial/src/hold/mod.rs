//! Heading hold: the block carries the heading of a fix while the instrument is moved.
//!
//! State: small attitude error φ in geographic axes (rad, estimate = (1 + φ ×) truth), what the gyros' biases are beyond their
//! estimate, δb, in block axes (rad/s), the attitude error φᵣ that was there when the block came to rest, and the biases β of the two
//! level accelerometers (rad of tilt, block axes), with a covariance of 11 × 11 carried a second at a time. φ grows by C δb dt and by the
//! gyros' white noise, δb is a constant of the run plus a Gauss-Markov process, φᵣ stays but for the creep that is allowed (a clone
//! of the state: Roumeliotis and Burdick, 2002), β is constant.
//!
//! The increments are always summed up. While the instrument stands it sways about where it came to rest: the second's mean turn
//! from there is a measurement of φ − φᵣ whose noise is the sway, which is estimated from the innovations. So the bias is known
//! from the whole angle over the whole time of standing, and what the base sways to and fro is no bias. Gravity measures the levels. A
//! second counts when the next one stands too: the first of a motion looks like standing. Biases are learned before there is a
//! heading as well, while the fix is made ([`Stood`]).
//!
//! Sway and shaking are noise of a second's mean with the variance s², estimated from the innovations: E e² = h·P·hᵀ + s². They
//! repeat themselves from second to second with the autocorrelation r, and a mean over many seconds has the variance s²·(1 + r)/(1 − r)/n
//! (a first-order process at frequency zero), so that this is what counts in the gain. An innovation is judged by its own
//! variance, h·P·hᵀ + s².
//!
//! Sigma grows with the class of the block ([`BlockClass`]); when it passes its limit a fix is asked for.

mod stood;

pub use stood::Stood;

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};
use quantities::earth::{EarthRate, LatitudeError, earth_rate};
use quantities::outer;
use quantities::units::{DEG_PER_RAD, RAD_PER_DEG};
use serde::{Deserialize, Serialize};

use super::coning::{Algorithm, Increment, Integrator, LONGEST_SAMPLE_S};
use super::quaternion::Quaternion;
use super::rotation::{Angles, cross_matrix};

/// °/h in rad/s.
const RAD_S_PER_DEG_H: f64 = RAD_PER_DEG / 3600.0;
const RAD_PER_ARCSEC: f64 = RAD_PER_DEG / 3600.0;
/// Innovations over which the sway is averaged: three a second.
const SWAY_SECONDS: f64 = 48.0;
/// With a heading that is known no better than this the Earth's rate is no measure of it: the equations hold for small angles. What of
/// the Earth's rate is then along the wrong axes is noise of the attitude that keeps for a minute.
const LOST_DEG: f64 = 10.0;
const LOST_S: f64 = 60.0;
/// No base stands stiller than this in the mean of a second, arcsec: rounding needs it.
const LEAST_SWAY_ARCSEC: f64 = 0.01;
/// Sway and shaking of a base before they are measured, arcsec.
const BEFORE_SWAY_ARCSEC: f64 = 20.0;
/// A noise that is much smaller than what else is in an innovation is learned as if it were this share of it, or it would never be.
const LEAST_SHARE: f64 = 0.5;
/// Autocorrelation of the sway from second to second: at first, and at most.
const FIRST_AUTOCORRELATION: f64 = 1.0 / 3.0;
const MOST_AUTOCORRELATION: f64 = 0.9;
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
    /// What a base that stands may turn for good, arcsec/√s.
    pub creep_arcsec_sqrt_s: f64,
    /// Sway of a base that stands, one sigma of a second's mean, arcsec: what it is taken for at first, and what is no motion.
    pub sway_arcsec: f64,
}

impl Default for HoldLimits {
    fn default() -> Self {
        Self { refix_deg: 0.5, creep_arcsec_sqrt_s: 0.1, sway_arcsec: 2.0 }
    }
}

/// What the base did in a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
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
    /// Squares of the second's innovations over their variances, summed up, and how many: a chi-square where sigmas are right.
    pub normalised_squared: f64,
    pub degrees_of_freedom: u32,
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

/// Places of the states.
const ATTITUDE: usize = 0;
const BIAS: usize = 3;
const REST: usize = 6;
const TILT: usize = 9;
const STATES: usize = 11;

type Covariance = SMatrix<f64, STATES, STATES>;
type State = SVector<f64, STATES>;

/// A heading that is held.
#[derive(Clone, Debug)]
pub struct Hold {
    class: BlockClass,
    limits: HoldLimits,
    /// Of the Earth in east, north, up, rad/s.
    earth_rad_s: Vector3<f64>,
    integrator: Integrator,
    orientation: Quaternion,
    /// Estimated, rad/s.
    bias_rad_s: Vector3<f64>,
    /// Estimated biases of the level accelerometers, rad of tilt, block axes.
    tilt_rad: Vector2<f64>,
    covariance: Covariance,
    /// Where it came to rest.
    rest: Quaternion,
    stands: bool,
    /// In a second's mean turn, and in a second's levels.
    sway: Noise,
    shaking: Noise,
    /// A second of standing that waits for the next one.
    waiting: Option<Waiting>,
    /// Rotation while it moved, rad, geographic axes: what errors of scale and axes have acted on. They are constants, so that a
    /// turn back takes away what the turn brought.
    turned_rad: Vector3<f64>,
    /// The same since it last stood: gravity tells the levels then.
    turned_since_rad: Vector3<f64>,
    /// Of this second's innovations: normalised squares, number.
    innovations: (f64, u32),
    second: Second,
    counters: HoldCounters,
}

/// What a second of standing said: mean turn from the rest, and support against gravity towards east and north less the
/// accelerometers' biases, as an angle.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    swayed_rad: Vector3<f64>,
    felt_rad: Vector2<f64>,
}

/// A second in the making.
#[derive(Clone, Debug, Default)]
struct Second {
    seconds: f64,
    angle_rad: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    /// Integral of the turn from the rest, geographic axes.
    swayed_rad_s: Vector3<f64>,
    /// Largest departure of the specific force's norm from gravity, m/s².
    shaken_m_s2: f64,
    saturated_rad: f64,
}

impl Hold {
    /// From a fix: orientation of the block with the sigmas of its heading and of its levels, degrees. The instrument stands.
    ///
    /// Errors: no latitude, or one near a pole.
    #[inline(never)]
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
        let tilt = square(class.accelerometer_m_s2 / GRAVITY_M_S2);
        // No second's mean is quieter than the accelerometers.
        let shaking = square(class.vrw_m_s_sqrt_s / GRAVITY_M_S2);
        let diagonal = State::from([level, level, heading, bias, bias, bias, 0.0, 0.0, 0.0, tilt, tilt]);
        let mut hold = Self {
            class: *class,
            limits,
            earth_rad_s: Vector3::new(0.0, north_deg_h, up_deg_h) * RAD_S_PER_DEG_H,
            integrator: Integrator::new(Algorithm::PreviousInterval),
            orientation,
            bias_rad_s: Vector3::zeros(),
            tilt_rad: Vector2::zeros(),
            covariance: Covariance::from_diagonal(&diagonal),
            rest: orientation,
            stands: false,
            sway: Noise::new(square(limits.sway_arcsec * RAD_PER_ARCSEC), square(LEAST_SWAY_ARCSEC * RAD_PER_ARCSEC)),
            shaking: Noise::new(shaking.max(square(BEFORE_SWAY_ARCSEC * RAD_PER_ARCSEC)), shaking),
            waiting: None,
            turned_rad: Vector3::zeros(),
            turned_since_rad: Vector3::zeros(),
            innovations: (0.0, 0),
            second: Second::default(),
            counters: HoldCounters::default(),
        };
        hold.come_to_rest();
        Ok(hold)
    }

    pub fn counters(&self) -> HoldCounters {
        self.counters
    }

    /// Block axes to geographic ones at the end of the last sample.
    pub fn orientation(&self) -> Quaternion {
        self.orientation
    }

    /// Estimated biases of the gyros, °/h.
    pub fn bias_deg_h(&self) -> [f64; 3] {
        (self.bias_rad_s / RAD_S_PER_DEG_H).into()
    }

    /// A sample of `dt_s` seconds. At the end of a second: what became of it.
    pub fn push(&mut self, dt_s: f64, mut sample: Increment) -> Option<HoldSecond> {
        let finite = sample.angle_rad.iter().chain(sample.velocity_m_s.iter()).all(|part| part.is_finite());
        if !(finite && dt_s > 0.0 && dt_s <= LONGEST_SAMPLE_S) {
            self.counters.invalid = self.counters.invalid.saturating_add(1);
            return None;
        }
        let range_rad = self.class.range_deg_s * RAD_PER_DEG * dt_s;
        let second = &mut self.second;
        if sample.angle_rad.amax() >= range_rad {
            self.counters.saturated = self.counters.saturated.saturating_add(1);
            // It may have been twice as fast; beyond the range no number says anything.
            second.saturated_rad += range_rad;
            sample.angle_rad = sample.angle_rad.map(|angle_rad| angle_rad.max(-range_rad).min(range_rad));
        }
        let corrected = Increment { angle_rad: sample.angle_rad - self.bias_rad_s * dt_s, ..sample };
        if let Some(interval) = self.integrator.push(corrected) {
            self.orientation = self.orientation.advance(&interval.angle_rad, &(self.earth_rad_s * dt_s));
        }
        // A turn of some arcseconds: twice the vector part.
        let turned = self.orientation.after(&self.rest.inverse());
        second.swayed_rad_s += turned.v * (2.0 * turned.w * dt_s);
        second.seconds += dt_s;
        second.angle_rad += sample.angle_rad - self.bias_rad_s * dt_s;
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
        self.innovations = (0.0, 0);
        self.leave();
        self.report(Motion::Bridged)
    }

    fn end_second(&mut self) -> HoldSecond {
        let second = core::mem::take(&mut self.second);
        self.innovations = (0.0, 0);
        let dt_s = second.seconds;
        self.propagate(dt_s, square(second.saturated_rad));
        let swayed = second.swayed_rad_s / dt_s;
        let noise = self.sway.variance.max(square(self.limits.sway_arcsec * RAD_PER_ARCSEC));
        let stands = second.shaken_m_s2 < MOTION_M_S2
            && second.saturated_rad == 0.0
            && swayed.iter().enumerate().all(|(axis, turn)| {
                let row = from_rest(axis);
                libm::fabs(*turn) < MOTION_SIGMAS * libm::sqrt(row.dot(&(self.covariance * row)) + noise)
            });
        if !stands {
            let turned = self.orientation.direction_cosines() * second.angle_rad;
            self.turned_rad += turned;
            self.turned_since_rad += turned;
            self.leave();
            return self.report(Motion::Moving);
        }
        if !self.stands {
            self.set_down();
        }
        let felt = self.orientation.rotate(&(second.velocity_m_s / dt_s - self.tilt_m_s2())) / GRAVITY_M_S2;
        let waiting = Waiting { swayed_rad: swayed, felt_rad: Vector2::new(felt.x, felt.y) };
        // What a gap has cut short is no second.
        if let Some(waiting) = self.waiting.replace(waiting)
            && dt_s > 0.5 * SECOND_S
        {
            self.stand(&waiting, dt_s);
        }
        self.report(Motion::Standing)
    }

    /// It moves: the next second may be the first of a rest.
    fn leave(&mut self) {
        (self.stands, self.waiting) = (false, None);
        self.come_to_rest();
    }

    /// The rest is where it is now, with the same errors.
    fn come_to_rest(&mut self) {
        self.rest = self.orientation;
        let rows = self.covariance.fixed_rows::<3>(ATTITUDE).into_owned();
        self.covariance.fixed_rows_mut::<3>(REST).copy_from(&rows);
        let columns = self.covariance.fixed_columns::<3>(ATTITUDE).into_owned();
        self.covariance.fixed_columns_mut::<3>(REST).copy_from(&columns);
    }

    /// What the turns of the way have done to the levels: gravity takes it out again.
    fn set_down(&mut self) {
        self.stands = true;
        let turned = core::mem::take(&mut self.turned_since_rad);
        let variance = self.of_turns(square(turned.x) + square(turned.y), turned.z * turned.z);
        for (a, b) in [(0, 0), (0, REST), (REST, 0), (REST, REST)] {
            for axis in 0..2 {
                if let Some(place) = self.covariance.get_mut((a + axis, b + axis)) {
                    *place += variance;
                }
            }
        }
    }

    /// Variance of an angle that scale makes of turns about its own axis, and misalignment of those about the others, rad².
    fn of_turns(&self, own_rad2: f64, others_rad2: f64) -> f64 {
        square(self.class.scale_ppm * 1e-6) * own_rad2
            + square(self.class.misalignment_arcsec * RAD_PER_ARCSEC) * others_rad2
    }

    /// The covariance over `dt_s`, with a further variance of each attitude angle, rad².
    fn propagate(&mut self, dt_s: f64, turned_rad2: f64) {
        let heading_rad2 = self.covariance.get((ATTITUDE + 2, ATTITUDE + 2)).copied().unwrap_or(0.0);
        let lost = heading_rad2 > square(LOST_DEG * RAD_PER_DEG);
        let seen = if lost { Vector3::zeros() } else { self.earth_rad_s };
        let unseen = if lost { self.earth_rad_s.norm_squared() * dt_s * LOST_S } else { 0.0 };
        // The attitude's error turns with the Earth's rate and grows with the biases; nothing else moves. Row by row and column by
        // column, where the covariance is: products of whole matrices would take a board five kilobytes of stack.
        let by_attitude = Matrix3::identity() - cross_matrix(&(seen * dt_s));
        let by_bias = self.orientation.direction_cosines() * dt_s;
        for state in 0..STATES {
            let column = by_attitude * self.covariance.fixed_view::<3, 1>(ATTITUDE, state)
                + by_bias * self.covariance.fixed_view::<3, 1>(BIAS, state);
            self.covariance.fixed_view_mut::<3, 1>(ATTITUDE, state).copy_from(&column);
        }
        for state in 0..STATES {
            let row = self.covariance.fixed_view::<1, 3>(state, ATTITUDE) * by_attitude.transpose()
                + self.covariance.fixed_view::<1, 3>(state, BIAS) * by_bias.transpose();
            self.covariance.fixed_view_mut::<1, 3>(state, ATTITUDE).copy_from(&row);
        }
        let attitude = self.white_rad2(dt_s) + turned_rad2 + unseen;
        // The Gauss-Markov process, taken for a random walk.
        let bias = 2.0 * square(self.class.markov_deg_h * RAD_S_PER_DEG_H) * dt_s / self.class.markov_s;
        let creep = square(self.limits.creep_arcsec_sqrt_s * RAD_PER_ARCSEC) * dt_s;
        let added = State::from([attitude, attitude, attitude, bias, bias, bias, creep, creep, creep, 0.0, 0.0]);
        for (state, added) in added.iter().enumerate() {
            if let Some(place) = self.covariance.get_mut((state, state)) {
                *place += added;
            }
        }
    }

    /// What the gyros' white noise adds to an angle, rad².
    fn white_rad2(&self, dt_s: f64) -> f64 {
        square(self.class.arw_deg_sqrt_h * RAD_PER_DEG / 60.0) * dt_s
    }

    /// What the second before this one, of the same length, said: mean turn from the rest, and levels.
    ///
    /// The mean turn is φ − φᵣ as it was then: less by the bias over 1.5 s, and without the white noise since. With q that of a second,
    /// the noise that now has and it has not, ∫ over this second and ∫ τ/T over that one, has the variance (1 + 1/3) q and the covariance
    /// (1 + 1/2) q with φ. Levels are those at that second's end, q less: the support is (1 + φ ×) up, so that its east part is φ north
    /// and its north part −φ east; the accelerometers add their biases, which do not average out.
    fn stand(&mut self, waiting: &Waiting, dt_s: f64) {
        let white = self.white_rad2(dt_s);
        let c = self.orientation.direction_cosines();
        let bias_over = |axis: usize, seconds: f64| c.row(axis).transpose() * (-seconds * dt_s);
        let mut x = State::zeros();
        for (axis, measured) in waiting.swayed_rad.iter().enumerate() {
            let mut row = from_rest(axis);
            row.fixed_rows_mut::<3>(BIAS).copy_from(&bias_over(axis, 1.5));
            let mut cross = self.covariance * row;
            let known = (row.dot(&cross) - 3.0 * white + 4.0 / 3.0 * white).max(0.0);
            if let Some(place) = cross.get_mut(ATTITUDE + axis) {
                *place -= 1.5 * white;
            }
            let innovation = measured - row.dot(&x);
            self.judge(known + self.sway.variance, innovation);
            self.sway.learn(axis, innovation, known);
            self.update(&mut x, &cross, known + self.sway.lasting(), innovation);
        }
        for (side, (tilt, sign)) in [(1, 1.0), (0, -1.0)].into_iter().enumerate() {
            let mut row = State::from_fn(|state, _| if state == ATTITUDE + tilt { sign } else { 0.0 });
            row.fixed_rows_mut::<3>(BIAS).copy_from(&(sign * bias_over(tilt, 1.0)));
            row.fixed_rows_mut::<2>(TILT).copy_from(&c.fixed_view::<1, 2>(side, 0).transpose());
            let mut cross = self.covariance * row;
            let known = (row.dot(&cross) - white).max(0.0);
            if let Some(place) = cross.get_mut(ATTITUDE + tilt) {
                *place -= sign * white;
            }
            let innovation = waiting.felt_rad.get(side).copied().unwrap_or(0.0) - row.dot(&x);
            self.judge(known + self.shaking.variance, innovation);
            self.shaking.learn(side, innovation, known);
            self.update(&mut x, &cross, known + self.shaking.lasting(), innovation);
        }
        self.feed_back(&x);
    }

    /// An innovation against its variance.
    fn judge(&mut self, variance: f64, innovation: f64) {
        self.innovations.0 += square(innovation) / variance;
        self.innovations.1 += 1;
    }

    /// What the gyros summed up before there was a heading: their mean rate less the Earth's is the bias, and a wrong heading or level
    /// is in it by what it turns of the Earth's rate, −Cᵀ·(Ω × φ).
    #[inline(never)]
    pub fn learn(&mut self, stood: &Stood) {
        let Some((rate_rad_s, seconds)) = stood.mean_rate() else { return };
        let white = self.white_rad2(1.0) / seconds;
        let swayed = 2.0 * square(BEFORE_SWAY_ARCSEC * RAD_PER_ARCSEC / seconds);
        let growth = 2.0 * square(self.class.markov_deg_h * RAD_S_PER_DEG_H) / self.class.markov_s;
        let noise = white + swayed + growth * seconds / 3.0;
        let c = self.orientation.direction_cosines();
        let by_attitude = -c.transpose() * cross_matrix(&self.earth_rad_s);
        let off = rate_rad_s - c.transpose() * self.earth_rad_s - self.bias_rad_s;
        let mut x = State::zeros();
        for (axis, off) in off.iter().enumerate() {
            let mut row = State::from_fn(|state, _| if state == BIAS + axis { 1.0 } else { 0.0 });
            row.fixed_rows_mut::<3>(ATTITUDE).copy_from(&by_attitude.row(axis).transpose());
            let cross = self.covariance * row;
            let innovation = off - row.dot(&x);
            self.update(&mut x, &cross, row.dot(&cross) + noise, innovation);
        }
        self.feed_back(&x);
        self.come_to_rest();
    }

    /// Estimated biases of the accelerometers, block axes.
    fn tilt_m_s2(&self) -> Vector3<f64> {
        Vector3::new(self.tilt_rad.x, self.tilt_rad.y, 0.0) * GRAVITY_M_S2
    }

    /// Takes an innovation into the error estimate `x`: its covariance with the state, its variance, its value.
    fn update(&mut self, x: &mut State, cross: &State, total: f64, innovation: f64) {
        let gain = cross / total;
        outer::add(&mut self.covariance, &-gain, cross);
        *x += gain * innovation;
    }

    /// What was found of the errors goes into the estimates, and out of what waits.
    fn feed_back(&mut self, x: &State) {
        let three = |first: usize| -> Vector3<f64> { x.fixed_rows::<3>(first).into() };
        let tilt: Vector2<f64> = x.fixed_rows::<2>(TILT).into();
        let turned = |orientation: &Quaternion, by: Vector3<f64>| {
            Quaternion::from_rotation_vector(&-by).after(orientation).normalised()
        };
        let c = self.orientation.direction_cosines();
        let attitude = three(ATTITUDE);
        if let Some(waiting) = &mut self.waiting {
            // It was measured, in the middle of the second, with what is corrected now.
            waiting.swayed_rad -= attitude - three(REST) - c * three(BIAS) * (0.5 * SECOND_S);
            waiting.felt_rad -= Vector2::new(attitude.y, -attitude.x) + c.fixed_view::<2, 2>(0, 0) * tilt;
        }
        self.orientation = turned(&self.orientation, attitude);
        self.rest = turned(&self.rest, three(REST));
        self.bias_rad_s += three(BIAS);
        self.tilt_rad += tilt;
    }

    /// While it stands the rest is reported where it is better known than the moment: gyros may be noisier than the sway.
    fn report(&self, motion: Motion) -> HoldSecond {
        let variance = |state: usize| self.covariance.get((state, state)).copied().unwrap_or(f64::INFINITY);
        let rested = variance(REST + 2) + self.sway.variance;
        let at_rest = motion == Motion::Standing && rested < variance(ATTITUDE + 2);
        let (first, orientation) = if at_rest { (REST, self.rest) } else { (ATTITUDE, self.orientation) };
        let turns = |turned: &Vector3<f64>| (square(turned.x) + square(turned.y), square(turned.z));
        let ((level, up), (since_level, since_up)) = (turns(&self.turned_rad), turns(&self.turned_since_rad));
        let heading = if at_rest { rested } else { variance(ATTITUDE + 2) } + self.of_turns(up, level);
        let levels = variance(first).max(variance(first + 1)) + self.of_turns(since_level, since_up);
        let sigma_heading_deg = (libm::sqrt(heading) * DEG_PER_RAD).min(180.0);
        HoldSecond {
            angles: orientation.angles(),
            sigma_heading_deg,
            sigma_level_deg: libm::sqrt(levels) * DEG_PER_RAD,
            motion,
            normalised_squared: self.innovations.0,
            degrees_of_freedom: self.innovations.1,
            refix: sigma_heading_deg > self.limits.refix_deg,
        }
    }
}

/// Noise of a base that stands, in the means of its seconds: its variance and its autocorrelation from second to second.
#[derive(Clone, Copy, Debug)]
struct Noise {
    variance: f64,
    least: f64,
    /// Means of the innovations' squares and of the products of neighbours, and the last ones of each axis.
    square: f64,
    product: f64,
    last: [f64; 3],
}

impl Noise {
    fn new(variance: f64, least: f64) -> Self {
        Self { variance, least, square: variance, product: FIRST_AUTOCORRELATION * variance, last: [0.0; 3] }
    }

    /// An innovation of one axis, of which `known` is the variance of what is not noise. Exponential means, in which it has the weight
    /// of what it tells: its square scatters by √2 of known + noise.
    fn learn(&mut self, axis: usize, innovation: f64, known: f64) {
        let share = (self.variance / (known + self.variance)).max(LEAST_SHARE);
        let weight = share * share / SWAY_SECONDS;
        self.variance = (self.variance + (square(innovation) - known - self.variance) * weight).max(self.least);
        if let Some(last) = self.last.get_mut(axis) {
            self.square += (square(innovation) - self.square) / SWAY_SECONDS;
            self.product += (innovation * core::mem::replace(last, innovation) - self.product) / SWAY_SECONDS;
        }
    }

    /// What counts in a mean over many seconds; a sway that is to and fro from second to second counts as white.
    fn lasting(&self) -> f64 {
        let r = (self.product / self.square.max(self.least)).clamp(0.0, MOST_AUTOCORRELATION);
        self.variance * (1.0 + r) / (1.0 - r)
    }
}

/// The attitude error less that of the rest about one axis.
fn from_rest(axis: usize) -> State {
    State::from_fn(|state, _| f64::from(u8::from(state == ATTITUDE + axis)) - f64::from(u8::from(state == REST + axis)))
}

fn square(value: f64) -> f64 {
    value * value
}

#[cfg(test)]
mod tests;

//! A block of three gyros and three accelerometers that stands, is carried to another place and stands again.
//!
//! Everything follows from the attitude and the place of its case at instants: gyros sum up the rotation against the stars from
//! one to the next, accelerometers feel the acceleration of the place less gravity, seen from the case.

use crate::geometry::{ARCSEC_PER_RAD, BaseAngles, earth_rate_rad_s};
use crate::noise::{Source, Stream};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Gravity, m/s².
const GRAVITY_M_S2: f64 = 9.80665;
/// Instants in a sample.
const INSTANTS: u32 = 4;
/// Step of the second difference that makes the acceleration, s.
const DIFFERENCE_S: f64 = 1e-3;

/// One sigma of what is wrong with a block; a run draws its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockErrors {
    /// °/√h.
    pub arw_deg_sqrt_h: f64,
    /// Bias of the run, °/h.
    pub run_to_run_deg_h: f64,
    /// Bias that wanders, °/h, with its time constant, s.
    pub markov_deg_h: f64,
    pub markov_s: f64,
    /// Scale factor, parts per million, and axes out of their directions, arcsec.
    pub scale_ppm: f64,
    pub misalignment_arcsec: f64,
    /// Bias of the accelerometers, m/s², and their noise, m/s/√s.
    pub accelerometer_m_s2: f64,
    pub vrw_m_s_sqrt_s: f64,
}

/// Where a block is carried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Carry {
    pub latitude_deg: f64,
    /// Heading at the start, degrees, and by how much it is turned clockwise on the way.
    pub heading_deg: f64,
    pub turn_deg: f64,
    /// Times of standing, being carried, standing again, s.
    pub stand_s: f64,
    pub carry_s: f64,
    pub stand_again_s: f64,
    /// Pitch and roll where it is set down, degrees.
    pub set_down_deg: [f64; 2],
}

/// A sample of 10 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockSample {
    /// Its end, s.
    pub t_s: f64,
    /// Length, s.
    pub dt_s: f64,
    /// Increments of angle about x, y, z, rad, and of velocity along them, m/s, as read.
    pub angle_rad: [f64; 3],
    pub velocity_m_s: [f64; 3],
    /// What is true at its end, degrees.
    pub heading_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
}

/// The block under way.
#[derive(Debug, Clone)]
pub struct CarriedBlock {
    carry: Carry,
    errors: BlockErrors,
    gyro_axes: Matrix3<f64>,
    gyro_bias_rad_s: Vector3<f64>,
    wander_rad_s: Vector3<f64>,
    accelerometer_m_s2: Vector3<f64>,
    stream: Stream,
    samples: u64,
}

impl CarriedBlock {
    /// The same seed gives the same errors and noise.
    pub fn new(carry: Carry, errors: BlockErrors, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Source::CarriedBlock);
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
        let per_hour = 1.0 / ARCSEC_PER_RAD;
        let gyro_bias_rad_s = draw(errors.run_to_run_deg_h * per_hour);
        let wander_rad_s = draw(errors.markov_deg_h * per_hour);
        let accelerometer_m_s2 = draw(errors.accelerometer_m_s2);
        let scale = draw(1e-6 * errors.scale_ppm);
        let (lower, upper) =
            (draw(errors.misalignment_arcsec / ARCSEC_PER_RAD), draw(errors.misalignment_arcsec / ARCSEC_PER_RAD));
        let gyro_axes = Matrix3::new(
            1.0 + scale.x,
            upper.x,
            upper.y, //
            lower.x,
            1.0 + scale.y,
            upper.z, //
            lower.y,
            lower.z,
            1.0 + scale.z,
        );
        Self { carry, errors, gyro_axes, gyro_bias_rad_s, wander_rad_s, accelerometer_m_s2, stream, samples: 0 }
    }

    /// Attitude, case to east, north, up.
    fn attitude(&self, t_s: f64) -> (BaseAngles, UnitQuaternion<f64>) {
        let Carry { heading_deg, turn_deg, set_down_deg, .. } = self.carry;
        let (way, held) = self.way(t_s);
        let swing = |amplitude_deg: f64, hz: f64, phase: f64| held * amplitude_deg * (TAU * hz * t_s + phase).sin();
        let angles = BaseAngles {
            pitch_rad: (way * set_down_deg[0] + swing(5.0, 1.8, 0.3)).to_radians(),
            roll_rad: (way * set_down_deg[1] + swing(4.0, 0.9, 1.1)).to_radians(),
            azimuth_rad: (heading_deg + way * turn_deg + swing(6.0, 0.45, 2.0)).to_radians(),
        };
        (angles, angles.attitude())
    }

    /// Place, east, north, up, m: a walk of 20 m to the east, with a bob at every step.
    fn place_m(&self, t_s: f64) -> Vector3<f64> {
        let (way, held) = self.way(t_s);
        Vector3::new(20.0 * way, 0.0, held * (0.8 + 0.03 * (TAU * 1.8 * t_s).sin()))
    }

    /// How far it has come, 0 to 1, and how far it is in the hands, 0 to 1; both without a jump in the acceleration.
    fn way(&self, t_s: f64) -> (f64, f64) {
        let smooth = |x: f64| {
            let x = x.clamp(0.0, 1.0);
            x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        };
        let Carry { stand_s, carry_s, .. } = self.carry;
        let since_s = t_s - stand_s;
        let lift_s = 2.0_f64.min(0.25 * carry_s);
        (smooth(since_s / carry_s), smooth(since_s / lift_s) * smooth((carry_s - since_s) / lift_s))
    }
}

impl Iterator for CarriedBlock {
    type Item = BlockSample;

    fn next(&mut self) -> Option<BlockSample> {
        let dt_s = 0.01;
        let start_s = self.samples as f64 * dt_s;
        let Carry { stand_s, carry_s, stand_again_s, latitude_deg, .. } = self.carry;
        if start_s >= stand_s + carry_s + stand_again_s - 0.5 * dt_s {
            return None;
        }
        self.samples += 1;
        let earth_rad_s = earth_rate_rad_s(latitude_deg);
        let step_s = dt_s / f64::from(INSTANTS);
        let (mut turned, mut pushed) = (Vector3::zeros(), Vector3::zeros());
        for instant in 0..INSTANTS {
            let from_s = start_s + f64::from(instant) * step_s;
            let ((_, before), (_, after)) = (self.attitude(from_s), self.attitude(from_s + step_s));
            let earth = UnitQuaternion::from_scaled_axis(earth_rad_s * step_s);
            turned += (before.inverse() * earth * after).scaled_axis();
            let middle_s = from_s + 0.5 * step_s;
            let place = |offset_s: f64| self.place_m(middle_s + offset_s);
            let acceleration =
                (place(DIFFERENCE_S) - place(0.0) * 2.0 + place(-DIFFERENCE_S)) / (DIFFERENCE_S * DIFFERENCE_S);
            let support = acceleration + Vector3::z() * GRAVITY_M_S2;
            pushed += self.attitude(middle_s).1.inverse() * support * step_s;
        }
        let errors = self.errors;
        let white = errors.arw_deg_sqrt_h.to_radians() / 60.0 * dt_s.sqrt();
        let keep = (-dt_s / errors.markov_s).exp();
        let renew = errors.markov_deg_h / ARCSEC_PER_RAD * (1.0 - keep * keep).sqrt();
        let stream = &mut self.stream;
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
        self.wander_rad_s = self.wander_rad_s * keep + draw(renew);
        let angle = self.gyro_axes * turned + (self.gyro_bias_rad_s + self.wander_rad_s) * dt_s + draw(white);
        let velocity = pushed + self.accelerometer_m_s2 * dt_s + draw(errors.vrw_m_s_sqrt_s * dt_s.sqrt());
        let t_s = start_s + dt_s;
        let (_, attitude) = self.attitude(t_s);
        let (mark, left) = (attitude * Vector3::x(), attitude * Vector3::y());
        Some(BlockSample {
            t_s,
            dt_s,
            angle_rad: angle.into(),
            velocity_m_s: velocity.into(),
            heading_deg: mark.x.atan2(mark.y).to_degrees().rem_euclid(360.0),
            pitch_deg: mark.z.asin().to_degrees(),
            roll_deg: (left.z / mark.z.asin().cos()).asin().to_degrees(),
        })
    }
}

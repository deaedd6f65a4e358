//! A block of three gyros and three accelerometers: what it feels, and what is wrong with what it says.
//!
//! Everything follows from the attitude of its case at instants: gyros sum up the rotation against the stars from one to the
//! next, accelerometers feel the acceleration of the place less gravity, seen from the case.

use crate::carry::Way;
use crate::geometry::{ARCSEC_PER_RAD, BaseAngles, GRAVITY_M_S2, earth_rate_rad_s};
use crate::noise::{Source, Stream};
use crate::scenario::{self, Carry};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The block with the errors that this run drew, and what it has summed up.
#[derive(Debug, Clone)]
pub struct Block {
    errors: scenario::Block,
    gyro_axes: Matrix3<f64>,
    gyro_bias_rad_s: Vector3<f64>,
    wander_rad_s: Vector3<f64>,
    accelerometer_m_s2: Vector3<f64>,
    stream: Stream,
    turned_rad: Vector3<f64>,
    pushed_m_s: Vector3<f64>,
    felt_s: f64,
}

impl Block {
    /// The same seed gives the same errors and noise.
    pub fn new(errors: &scenario::Block, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Source::CarriedBlock);
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
        let gyro_bias_rad_s = draw(errors.run_to_run_deg_h / ARCSEC_PER_RAD);
        let wander_rad_s = draw(errors.markov_deg_h / ARCSEC_PER_RAD);
        let accelerometer_m_s2 = draw(errors.accelerometer_m_s2);
        let scale = draw(1e-6 * errors.scale_ppm);
        let askew = errors.misalignment_arcsec / ARCSEC_PER_RAD;
        let (lower, upper) = (draw(askew), draw(askew));
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
        Self {
            errors: errors.clone(),
            gyro_axes,
            gyro_bias_rad_s,
            wander_rad_s,
            accelerometer_m_s2,
            stream,
            turned_rad: Vector3::zeros(),
            pushed_m_s: Vector3::zeros(),
            felt_s: 0.0,
        }
    }

    /// Within `dt_s` the case went from one attitude (to east, north, up) to the next, on a place that was accelerated.
    pub fn feel(
        &mut self,
        [before, after]: [&UnitQuaternion<f64>; 2],
        acceleration_m_s2: &Vector3<f64>,
        earth_rad_s: &Vector3<f64>,
        dt_s: f64,
    ) {
        let earth = UnitQuaternion::from_scaled_axis(earth_rad_s * dt_s);
        self.turned_rad += (before.inverse() * earth * after).scaled_axis();
        let support = acceleration_m_s2 + Vector3::z() * GRAVITY_M_S2;
        self.pushed_m_s += before.slerp(after, 0.5).inverse() * support * dt_s;
        self.felt_s += dt_s;
    }

    /// Ends an interval: increments of angle about x, y, z, rad, and of velocity along them, m/s, as read.
    pub fn increments(&mut self) -> [[f64; 3]; 2] {
        let errors = &self.errors;
        let dt_s = self.felt_s;
        let white = errors.arw_deg_per_sqrt_h.to_radians() / 60.0 * dt_s.sqrt();
        let keep = (-dt_s / errors.markov_s).exp();
        let renew = errors.markov_deg_h / ARCSEC_PER_RAD * (1.0 - keep * keep).sqrt();
        let most_rad = errors.saturation_deg_s.to_radians() * dt_s;
        let stream = &mut self.stream;
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * stream.normal());
        self.wander_rad_s = self.wander_rad_s * keep + draw(renew);
        let angle = self.gyro_axes * self.turned_rad + (self.gyro_bias_rad_s + self.wander_rad_s) * dt_s + draw(white);
        let velocity = self.pushed_m_s + self.accelerometer_m_s2 * dt_s + draw(errors.vrw_m_s_per_sqrt_s * dt_s.sqrt());
        (self.turned_rad, self.pushed_m_s, self.felt_s) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        [angle.map(|rad| rad.clamp(-most_rad, most_rad)).into(), velocity.into()]
    }
}

/// Instants in a sample of a block on its own.
const INSTANTS: u32 = 4;

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

/// A block on its own, without an instrument around it: it stands level for the time of waiting, is carried, stands again.
#[derive(Debug, Clone)]
pub struct CarriedBlock {
    block: Block,
    way: Way,
    earth_rad_s: Vector3<f64>,
    heading_rad: f64,
    end_s: f64,
    samples: u64,
}

impl CarriedBlock {
    /// Lifted at `heading_deg`. The same seed gives the same errors and noise.
    pub fn new(latitude_deg: f64, heading_deg: f64, carry: &Carry, errors: &scenario::Block, seed: u64) -> Self {
        Self {
            block: Block::new(errors, seed),
            way: Way::new(carry, carry.wait_s),
            earth_rad_s: earth_rate_rad_s(latitude_deg),
            heading_rad: heading_deg.to_radians(),
            end_s: carry.wait_s + carry.walk_s + carry.stand_s,
            samples: 0,
        }
    }

    /// Case to east, north, up.
    fn attitude(&self, t_s: f64) -> UnitQuaternion<f64> {
        let turned = self.way.turned(t_s);
        BaseAngles { azimuth_rad: self.heading_rad + turned.azimuth_rad, ..turned }.attitude()
    }
}

impl Iterator for CarriedBlock {
    type Item = BlockSample;

    fn next(&mut self) -> Option<BlockSample> {
        let dt_s = 0.01;
        let start_s = self.samples as f64 * dt_s;
        if start_s >= self.end_s - 0.5 * dt_s {
            return None;
        }
        self.samples += 1;
        let step_s = dt_s / f64::from(INSTANTS);
        for instant in 0..INSTANTS {
            let from_s = start_s + f64::from(instant) * step_s;
            let (before, after) = (self.attitude(from_s), self.attitude(from_s + step_s));
            let acceleration = self.way.acceleration_m_s2(from_s + 0.5 * step_s);
            self.block.feel([&before, &after], &acceleration, &self.earth_rad_s, step_s);
        }
        let [angle_rad, velocity_m_s] = self.block.increments();
        let t_s = start_s + dt_s;
        let attitude = self.attitude(t_s);
        let (mark, left) = (attitude * Vector3::x(), attitude * Vector3::y());
        Some(BlockSample {
            t_s,
            dt_s,
            angle_rad,
            velocity_m_s,
            heading_deg: mark.x.atan2(mark.y).to_degrees().rem_euclid(360.0),
            pitch_deg: mark.z.asin().to_degrees(),
            roll_deg: (left.z / mark.z.asin().cos()).asin().to_degrees(),
        })
    }
}

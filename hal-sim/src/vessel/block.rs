//! The block's errors: what its gyros and accelerometers read of the true motion.

use nalgebra::{Rotation3, Vector3};

use super::ship::Step;
use crate::noise::{GaussMarkov, Source, Stream};

/// Standard deviations of a class of blocks.
#[derive(Clone, Copy, Debug)]
pub struct BlockClass {
    pub scale_percent: f64,
    pub run_to_run_deg_h: f64,
    pub markov_deg_h: f64,
    pub markov_s: f64,
    /// Angle random walk.
    pub white_deg_per_sqrt_h: f64,
    pub orthogonality_arcsec: f64,
    /// Fixed to the hull: starboard and forward each.
    pub rhumb_deg_h: f64,
    pub accelerometer_m_s2: f64,
    pub accelerometer_white_m_s_per_sqrt_s: f64,
}

impl BlockClass {
    /// The source's fibre-optic block: 20 °/h in means of 0.1 s are 0.105 °/√h.
    pub const FOG: Self = Self {
        scale_percent: 0.3,
        run_to_run_deg_h: 3.0,
        markov_deg_h: 1.0,
        markov_s: 600.0,
        white_deg_per_sqrt_h: 0.105409,
        orthogonality_arcsec: 10.0,
        rhumb_deg_h: 0.5,
        accelerometer_m_s2: 0.03,
        accelerometer_white_m_s_per_sqrt_s: 1e-4,
    };
    /// The source's MEMS hardware: 0.1 °/s, 0.07 °/s/√Hz (4.2 °/√h), 0.03 m/s², 0.02 m/s²/√Hz.
    pub const MEMS_HARDWARE: Self = Self {
        scale_percent: 0.3,
        run_to_run_deg_h: 360.0,
        markov_deg_h: 36.0,
        markov_s: 600.0,
        white_deg_per_sqrt_h: 4.2,
        orthogonality_arcsec: 206.264806,
        rhumb_deg_h: 0.0,
        accelerometer_m_s2: 0.03,
        accelerometer_white_m_s_per_sqrt_s: 0.02,
    };
    /// The class of the source's introduction: 0.01 °/s, 0.1 m/s²; noise of the hardware.
    pub const MEMS_INTRODUCTION: Self =
        Self { run_to_run_deg_h: 36.0, markov_deg_h: 3.6, accelerometer_m_s2: 0.1, ..Self::MEMS_HARDWARE };
    /// Sensonor STIM300, data sheet TS1524.
    pub const STIM300: Self = Self {
        scale_percent: 0.05,
        run_to_run_deg_h: 5.0,
        markov_deg_h: 0.5,
        markov_s: 600.0,
        white_deg_per_sqrt_h: 0.15,
        orthogonality_arcsec: 206.264806,
        rhumb_deg_h: 0.0,
        accelerometer_m_s2: 0.00735499,
        accelerometer_white_m_s_per_sqrt_s: 0.001,
    };
}

/// One block with the errors that it has.
#[derive(Clone, Debug)]
pub struct Block {
    class: BlockClass,
    /// Directions in which the gyros really look.
    axes: [Vector3<f64>; 3],
    /// Gains of the gyros.
    pub gains: Vector3<f64>,
    /// °/h, block axes.
    pub run_to_run_deg_h: Vector3<f64>,
    /// °/h, starboard and forward.
    pub rhumb_deg_h: Vector3<f64>,
    /// m/s².
    pub accelerometer_m_s2: Vector3<f64>,
    markov: [GaussMarkov; 3],
    gyro_noise: Stream,
    slow_noise: Stream,
    accelerometer_noise: Stream,
}

impl Block {
    /// A block of a class; equal seeds are equal blocks.
    pub fn new(class: BlockClass, seed: u64) -> Self {
        let mut draw = Stream::new(seed, Source::BlockConstants);
        let mut slow_noise = Stream::new(seed, Source::BlockSlow);
        let mut three = |sigma: f64| Vector3::from_fn(|_, _| sigma * draw.normal());
        let gains = three(0.01 * class.scale_percent).add_scalar(1.0);
        let run_to_run_deg_h = three(class.run_to_run_deg_h);
        let skew = three(class.orthogonality_arcsec / 206_264.806);
        let rhumb_deg_h = three(class.rhumb_deg_h).component_mul(&Vector3::new(1.0, 1.0, 0.0));
        let accelerometer_m_s2 = three(class.accelerometer_m_s2);
        Self {
            class,
            axes: [
                Vector3::new(1.0, skew.x, skew.y).normalize(),
                Vector3::new(0.0, 1.0, skew.z).normalize(),
                Vector3::z(),
            ],
            gains,
            run_to_run_deg_h,
            rhumb_deg_h,
            accelerometer_m_s2,
            markov: std::array::from_fn(|_| GaussMarkov::new(class.markov_deg_h, class.markov_s, &mut slow_noise)),
            gyro_noise: Stream::new(seed, Source::BlockGyro),
            slow_noise,
            accelerometer_noise: Stream::new(seed, Source::BlockAccelerometer),
        }
    }

    /// What it reads over a step of `dt_s`: angle increments, rad, and velocity increments, m/s.
    pub fn read(&mut self, step: &Step, dt_s: f64) -> ([f64; 3], [f64; 3]) {
        let deg_h = (1.0f64 / 3600.0).to_radians();
        let on_hull = Rotation3::from_axis_angle(&Vector3::z_axis(), step.end.turn_rad);
        let rhumb = on_hull.inverse() * self.rhumb_deg_h;
        let white = self.class.white_deg_per_sqrt_h.to_radians() / 60.0 * dt_s.sqrt();
        let angles = std::array::from_fn(|axis| {
            let slow = self.markov[axis].advance(dt_s, &mut self.slow_noise);
            let drift = self.run_to_run_deg_h[axis] + slow + rhumb[axis];
            self.gains[axis] * self.axes[axis].dot(&step.angle_rad)
                + drift * deg_h * dt_s
                + white * self.gyro_noise.normal()
        });
        let shake = self.class.accelerometer_white_m_s_per_sqrt_s * dt_s.sqrt();
        let velocities = std::array::from_fn(|axis| {
            step.velocity_m_s[axis] + self.accelerometer_m_s2[axis] * dt_s + shake * self.accelerometer_noise.normal()
        });
        (angles, velocities)
    }
}

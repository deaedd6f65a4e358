//! A triad of fibre-optic gyros with its errors.

use crate::noise::{SlowBias, Source, Stream};
use nalgebra::{Matrix3, Vector3};

/// What is wrong with a triad.
#[derive(Debug, Clone, PartialEq)]
pub struct TriadErrors {
    /// Bias of x, y, z at 25 °C, °/h.
    pub bias_deg_h: [f64; 3],
    /// Change of the bias with temperature, °/h per K.
    pub bias_deg_h_per_k: [f64; 3],
    /// Scale error of x, y, z, parts per million.
    pub scale_ppm: [f64; 3],
    /// Tilts of the sensitive axes: x towards y and z, y towards x and z, z towards x and y, arcsec.
    pub tilt_arcsec: [[f64; 2]; 3],
    /// Angle random walk, °/√h.
    pub arw_deg_per_sqrt_h: f64,
    /// Bias instability (B of IEEE Std 952), °/h.
    pub bias_instability_deg_h: f64,
}

impl Default for TriadErrors {
    /// A triad without errors but for the noise of a good fibre-optic gyro.
    fn default() -> Self {
        Self {
            bias_deg_h: [0.0; 3],
            bias_deg_h_per_k: [0.0; 3],
            scale_ppm: [0.0; 3],
            tilt_arcsec: [[0.0; 2]; 3],
            arw_deg_per_sqrt_h: 0.0015,
            bias_instability_deg_h: 0.0,
        }
    }
}

/// The triad in use.
#[derive(Debug, Clone)]
pub struct GyroTriad {
    errors: TriadErrors,
    /// Rows: sensitive axes in the case, times scale factor.
    axes: Matrix3<f64>,
    slow: [SlowBias; 3],
    stream: Stream,
    temp_c: f64,
}

/// Temperature at which the biases are given, °C.
pub(super) const REFERENCE_C: f64 = 25.0;

impl GyroTriad {
    /// Switched on. The same seed gives the same noise.
    pub fn new(errors: &TriadErrors, seed: u64) -> Self {
        let tilt = errors.tilt_arcsec.map(|[a, b]| [a / 3600.0, b / 3600.0].map(f64::to_radians));
        let [x, y, z] = tilt;
        let directions = [Vector3::new(1.0, x[0], x[1]), Vector3::new(y[0], 1.0, y[1]), Vector3::new(z[0], z[1], 1.0)];
        let mut axes = Matrix3::zeros();
        for (row, (direction, ppm)) in directions.iter().zip(errors.scale_ppm).enumerate() {
            axes.set_row(row, &(direction.normalize() * (1.0 + 1e-6 * ppm)).transpose());
        }
        let slow = [0, 1, 2].map(|axis| {
            // Streams of their own for the three: the seed is spread.
            let seed = seed.wrapping_mul(3).wrapping_add(axis);
            SlowBias::new(errors.bias_instability_deg_h, 0.0, Stream::new(seed, Source::GyroSlow))
        });
        Self { errors: errors.clone(), axes, slow, stream: Stream::new(seed, Source::GyroWhite), temp_c: REFERENCE_C }
    }

    /// Sets the temperature of the gyros, °C.
    pub(super) fn set_temperature(&mut self, temp_c: f64) {
        self.temp_c = temp_c;
    }

    /// What the gyros give without bias and noise for a rotation of the case about its x, y, z.
    pub fn response(&self, rotation: [f64; 3]) -> [f64; 3] {
        (self.axes * Vector3::from(rotation)).into()
    }

    /// Rows: gyro x, y, z; columns: its response to rotation about x, y, z.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        self.axes.transpose().into()
    }

    /// Angle increments in arcsec over `dt_s` in which the case turned by these angles against the stars, about its x, y,
    /// z, arcsec.
    pub fn measure(&mut self, turned_arcsec: [f64; 3], dt_s: f64) -> [f64; 3] {
        let mut increments = self.response(turned_arcsec);
        // 1 °/√h is 60 arcsec/√s.
        let noise_arcsec = 60.0 * self.errors.arw_deg_per_sqrt_h * dt_s.sqrt();
        let warmer_k = self.temp_c - REFERENCE_C;
        let TriadErrors { bias_deg_h, bias_deg_h_per_k, .. } = self.errors;
        for (((increment, bias), per_k), slow) in
            increments.iter_mut().zip(bias_deg_h).zip(bias_deg_h_per_k).zip(&mut self.slow)
        {
            *increment += (bias + per_k * warmer_k + slow.advance(dt_s)) * dt_s + noise_arcsec * self.stream.normal();
        }
        increments
    }
}

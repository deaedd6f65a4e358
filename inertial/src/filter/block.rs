//! Error classes of inertial blocks: what the filter is told of the gyros and accelerometers before it starts.

use quantities::units::{RAD_PER_DEG, STANDARD_GRAVITY_M_S2};

const DEG_H: f64 = RAD_PER_DEG / 3600.0;
const ARCSEC: f64 = RAD_PER_DEG / 3600.0;

/// Standard deviations of a block's errors, SI units, block axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockErrors {
    /// Angle random walk, rad/√s.
    pub gyro_white_rad_per_sqrt_s: f64,
    /// Gauss-Markov drift, rad/s.
    pub gyro_markov_rad_s: f64,
    /// Its time constant, s.
    pub gyro_markov_s: f64,
    /// Drift that is constant from switch-on, rad/s.
    pub gyro_run_to_run_rad_s: f64,
    /// Scale factor, relative.
    pub gyro_scale: f64,
    /// Each angle of the gyro axes' orthogonality, rad.
    pub orthogonality_rad: f64,
    /// Drift fixed to the hull, each horizontal axis, rad/s.
    pub rhumb_rad_s: f64,
    /// Accelerometer bias, m/s².
    pub accelerometer_bias_m_s2: f64,
    /// Velocity random walk, m/s/√s.
    pub accelerometer_white_m_s_per_sqrt_s: f64,
}

impl BlockErrors {
    /// The source's fibre-optic block: 0.3 %, 3 °/h run to run, 1 °/h with 600 s, 20 °/h white at 0.1 s, 10″, rhumb drift
    /// 0.5 °/h; accelerometers of 0.03 m/s² bias, whose noise the satellite velocity hides.
    pub const FOG: Self = Self {
        // 20 °/h · √0.1 s.
        gyro_white_rad_per_sqrt_s: 20.0 * DEG_H * 0.316_227_766_016_837_94,
        gyro_markov_rad_s: DEG_H,
        gyro_markov_s: 600.0,
        gyro_run_to_run_rad_s: 3.0 * DEG_H,
        gyro_scale: 0.003,
        orthogonality_rad: 10.0 * ARCSEC,
        rhumb_rad_s: 0.5 * DEG_H,
        accelerometer_bias_m_s2: 0.03,
        accelerometer_white_m_s_per_sqrt_s: 1e-4,
    };

    /// The source's MEMS hardware: gyro 0.1 °/s, 0.07 °/s/√Hz; accelerometer 0.03 m/s², 0.02 m/s²/√Hz.
    pub const MEMS_HARDWARE: Self = Self {
        gyro_white_rad_per_sqrt_s: 0.07 * RAD_PER_DEG,
        gyro_markov_rad_s: 0.01 * RAD_PER_DEG,
        gyro_markov_s: 600.0,
        gyro_run_to_run_rad_s: 0.1 * RAD_PER_DEG,
        gyro_scale: 0.003,
        orthogonality_rad: 0.001,
        rhumb_rad_s: 0.0,
        accelerometer_bias_m_s2: 0.03,
        accelerometer_white_m_s_per_sqrt_s: 0.02,
    };

    /// The class that the source's introduction names: gyro 0.01 °/s, accelerometer 0.1 m/s²; noise as its hardware.
    pub const MEMS_INTRODUCTION: Self = Self {
        gyro_markov_rad_s: 0.001 * RAD_PER_DEG,
        gyro_run_to_run_rad_s: 0.01 * RAD_PER_DEG,
        accelerometer_bias_m_s2: 0.1,
        ..Self::MEMS_HARDWARE
    };

    /// A ring-laser block of navigation grade, as the hold's class: 0.002 °/√h, 0.01 °/h, 10 ppm, 5″; accelerometers 50 µg.
    pub const RING_LASER: Self = Self {
        gyro_white_rad_per_sqrt_s: 0.002 * RAD_PER_DEG / 60.0,
        gyro_markov_rad_s: 0.003 * DEG_H,
        gyro_markov_s: 600.0,
        gyro_run_to_run_rad_s: 0.01 * DEG_H,
        gyro_scale: 10e-6,
        orthogonality_rad: 5.0 * ARCSEC,
        rhumb_rad_s: 0.0,
        accelerometer_bias_m_s2: 0.0005,
        accelerometer_white_m_s_per_sqrt_s: 1e-4,
    };

    /// A modern part, Sensonor STIM300 (data sheet TS1524): 0.15 °/√h, bias instability 0.5 °/h, 5 °/h over temperature,
    /// 500 ppm, 1 mrad; accelerometers 0.75 mg from switch-on, 0.06 m/s/√h.
    pub const STIM300: Self = Self {
        gyro_white_rad_per_sqrt_s: 0.15 * RAD_PER_DEG / 60.0,
        gyro_markov_rad_s: 0.5 * DEG_H,
        gyro_markov_s: 600.0,
        gyro_run_to_run_rad_s: 5.0 * DEG_H,
        gyro_scale: 500e-6,
        orthogonality_rad: 0.001,
        rhumb_rad_s: 0.0,
        accelerometer_bias_m_s2: 0.75e-3 * STANDARD_GRAVITY_M_S2,
        accelerometer_white_m_s_per_sqrt_s: 0.001,
    };
}

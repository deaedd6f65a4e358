//! What an instrument tries to find out.

use serde::Serialize;

/// What is really so, as of the last sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Truth {
    /// Time since power-up, s.
    pub t_s: f64,
    /// Azimuth of the mark's horizontal projection, degrees clockwise from true north, 0 ..= 360.
    pub azimuth_deg: f64,
    /// Index angle of the gyro's sensitive axis, degrees counter-clockwise from the mark; counts turns.
    pub index_deg: f64,
    /// Pitch of the base, degrees, nose up positive.
    pub pitch_deg: f64,
    /// Roll of the base, degrees, left side up positive.
    pub roll_deg: f64,
    /// Bias of the gyro from all causes but the noise from sample to sample, °/h.
    pub bias_deg_h: f64,
    /// Temperature of the gyro, °C.
    pub temp_c: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
    /// Vibration, g rms.
    pub vibration_g: f64,
    /// Step pulses that the drive did not follow.
    pub lost_steps: u64,
}

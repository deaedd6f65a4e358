//! The gyro's electronics: full scale, quantisation, frame clock, status, faults.

use crate::frames::Frame;
use crate::scenario::{Gyro, GyroFaultKind};
use crate::window;

/// Units of the frame's increment in an arcsec.
const UNITS_PER_ARCSEC: f64 = 1e6;
/// The tick that the frames are declared for, s.
const TICK_S: f64 = 0.0025;
/// Frames in a tick by the clock of KVH's family, 1000 Hz.
const OWN_CLOCK_PER_TICK: f64 = 2.5;
/// What an invalid temperature reads, °C.
const NO_TEMPERATURE_C: f64 = -327.68;

/// Rounds angles to the output step; what is cut off stays in the counter, so that no angle is lost.
#[derive(Debug, Clone)]
pub struct Quantizer {
    quantum_arcsec: f64,
    left_arcsec: f64,
}

impl Quantizer {
    /// A counter with that step.
    pub fn new(quantum_arcsec: f64) -> Self {
        Self { quantum_arcsec, left_arcsec: 0.0 }
    }

    /// The whole steps in the angle so far, arcsec.
    pub fn take(&mut self, arcsec: f64) -> f64 {
        let total = self.left_arcsec + arcsec;
        let whole = (total / self.quantum_arcsec).round() * self.quantum_arcsec;
        self.left_arcsec = total - whole;
        whole
    }
}

/// From analogue increments to frames.
#[derive(Debug, Clone)]
pub struct GyroOutput {
    gyro: Gyro,
    quantizer: Quantizer,
    phase: f64,
    pending_arcsec: f64,
    sequence: u8,
    last_uas: i32,
}

impl GyroOutput {
    /// Electronics at power-up.
    pub fn new(gyro: &Gyro) -> Self {
        Self {
            gyro: gyro.clone(),
            quantizer: Quantizer::new(gyro.quantum_arcsec),
            phase: 0.0,
            pending_arcsec: 0.0,
            sequence: 0,
            last_uas: 0,
        }
    }

    /// Takes the angle of a tick that ends at `t_s` and gives the frames that were completed in it, with the length of their interval, s.
    pub fn tick(
        &mut self,
        t_s: f64,
        increment_arcsec: f64,
        temp_c: f64,
        own_clock: bool,
        mut send: impl FnMut(Frame, f64),
    ) {
        let per_tick = if own_clock { OWN_CLOCK_PER_TICK } else { self.gyro.frames_per_tick };
        let mut used = 0.0;
        while self.phase + per_tick * (1.0 - used) >= 1.0 {
            let part = (1.0 - self.phase) / per_tick;
            used += part;
            self.phase = 0.0;
            let angle = self.pending_arcsec + increment_arcsec * part;
            self.pending_arcsec = 0.0;
            if let Some(frame) = self.frame(t_s, angle, temp_c) {
                send(frame, TICK_S / per_tick);
            }
        }
        self.pending_arcsec += increment_arcsec * (1.0 - used);
        self.phase += per_tick * (1.0 - used);
    }

    fn has(&self, kind: GyroFaultKind, t_s: f64) -> bool {
        self.gyro.faults.iter().any(|fault| fault.kind == kind && window::contains(fault.from_s, fault.to_s, t_s))
    }

    fn frame(&mut self, t_s: f64, angle_arcsec: f64, temp_c: f64) -> Option<Frame> {
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        if t_s < self.gyro.startup_s || self.has(GyroFaultKind::Silent, t_s) {
            return None;
        }
        let full_arcsec = self.gyro.full_scale_deg_s * 3600.0 * TICK_S;
        let overdriven = self.has(GyroFaultKind::Saturated, t_s);
        let saturated = overdriven || angle_arcsec.abs() > full_arcsec;
        let seen_arcsec = if overdriven { full_arcsec } else { angle_arcsec.clamp(-full_arcsec, full_arcsec) };
        if !self.has(GyroFaultKind::Stuck, t_s) {
            // Full scale is at most 230 °/s, 2070 arcsec a tick: the number of units fits.
            self.last_uas = (self.quantizer.take(seen_arcsec) * UNITS_PER_ARCSEC).round() as i32;
        }
        let temp_valid = !self.has(GyroFaultKind::TemperatureInvalid, t_s);
        Some(Frame {
            increment_uas: self.last_uas,
            temp_c: if temp_valid { temp_c } else { NO_TEMPERATURE_C },
            sequence,
            valid: !self.has(GyroFaultKind::Invalid, t_s),
            saturated,
            temp_valid,
        })
    }
}

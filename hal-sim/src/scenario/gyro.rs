//! Settings of the simulated gyro: errors, format, faults.

use super::check::{Any, Choice, Each, part};
use serde::{Deserialize, Serialize};

/// The frame that the gyro sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GyroFormat {
    /// The compact single-axis frame, 14 bytes.
    Compact,
    /// KVH format A, 36 bytes, the axis on X.
    KvhA,
}

/// What goes wrong with the gyro in a window of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GyroFaultKind {
    /// No frames at all.
    Silent,
    /// Frames come with the status "not valid".
    Invalid,
    /// The light source is overdriven: full-scale output with the status "saturated".
    Saturated,
    /// The last increment is repeated for ever; status stays good.
    Stuck,
    /// The temperature is marked as not valid and reads the lowest number.
    TemperatureInvalid,
}

part! {
    /// A fault of the gyro.
    GyroFault {
        /// What goes wrong.
        kind: GyroFaultKind = GyroFaultKind::Silent, Choice;
        /// Begins, s.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// A bias that depends on the index angle: amplitude · cos(order · (θ − phase)). Order 1 is a field fixed to the
    /// instrument's body, such as a magnet in the base.
    Harmonic {
        /// How many periods in one turn.
        order: u32 = 1, 1..=36;
        /// Amplitude, °/h.
        amplitude_deg_h: f64 = 0.0, 0.0..=1000.0;
        /// Index angle of a maximum, degrees.
        phase_deg: f64 = 0.0, -360.0..=360.0;
    }
}

part! {
    /// The gyro. Rates in °/h (1 °/h for 1 s is 1 arcsec); every error is added to what a perfect gyro would read.
    Gyro {
        /// Frame format on the line.
        format: GyroFormat = GyroFormat::Compact, Choice;
        /// Angle random walk, °/√h.
        arw_deg_per_sqrt_h: f64 = 0.0015, 0.0..=10.0;
        /// Bias at the reference temperature, °/h.
        bias_deg_h: f64 = 0.3, -1000.0..=1000.0;
        /// Bias instability B of IEEE Std 952, °/h: the Allan deviation levels off at 0.664 B.
        bias_instability_deg_h: f64 = 0.002, 0.0..=100.0;
        /// Rate random walk, °/h/√h.
        rrw_deg_h_per_sqrt_h: f64 = 0.002, 0.0..=100.0;
        /// Linear drift of the bias, °/h per hour.
        drift_deg_h_per_h: f64 = 0.0, -1000.0..=1000.0;
        /// Scale factor error, parts per million: the output is too large when positive.
        scale_ppm: f64 = 200.0, -100000.0..=100000.0;
        /// Change of the scale factor with temperature, ppm/K.
        scale_ppm_per_k: f64 = 0.0, -1000.0..=1000.0;
        /// Depth of a dead-zone-like loss of rate near zero, °/h: the output lacks at most this much.
        dead_zone_deg_h: f64 = 0.0, -10.0..=10.0;
        /// Rate at which that loss is greatest, °/h.
        dead_zone_width_deg_h: f64 = 2.0, 0.01..=1000.0;
        /// Cubic non-linearity, °/h per (°/h)³.
        cubic_per_deg_h2: f64 = 0.0, -0.001..=0.001;
        /// Angle by which the sensitive axis stands above the plane normal to the spindle, arcsec.
        axis_elevation_arcsec: f64 = 0.0, -36000.0..=36000.0;
        /// Tilt of the spindle against the instrument's z towards x and towards y, arcsec.
        spindle_tilt_arcsec: [f64; 2] = [0.0; 2], -36000.0..=36000.0;
        /// Temperature at which bias and scale are declared, °C.
        reference_c: f64 = 20.0, -60.0..=85.0;
        /// Bias per kelvin, °/h/K.
        bias_deg_h_per_k: f64 = 0.0, -100.0..=100.0;
        /// Bias per kelvin squared, °/h/K².
        bias_deg_h_per_k2: f64 = 0.0, -10.0..=10.0;
        /// Bias per rate of temperature (Shupe), °/h per K/s.
        shupe_deg_h_per_k_s: f64 = 0.0, -10000.0..=10000.0;
        /// Hysteresis: bias after warming minus that after cooling is twice this, °/h.
        hysteresis_deg_h: f64 = 0.0, -100.0..=100.0;
        /// Change of temperature that takes it from one side to the other, K.
        hysteresis_width_k: f64 = 2.0, 0.01..=100.0;
        /// Temperature of the gyro above ambient at switch-on, K (negative: comes from the cold).
        start_offset_k: f64 = 0.0, -80.0..=80.0;
        /// Steady warming by its own power, K.
        self_heating_k: f64 = 0.0, 0.0..=60.0;
        /// Thermal time constant, s.
        thermal_tau_s: f64 = 900.0, 1.0..=100000.0;
        /// Thermal time constant of the housing, where an inertial block sits, s.
        housing_tau_s: f64 = 600.0, 1.0..=100000.0;
        /// Stress between coil and housing: bias for each kelvin of the gyro times each kelvin of the housing, °/h/K².
        housing_deg_h_per_k2: f64 = 0.0, -10.0..=10.0;
        /// Error of the temperature sensor, K.
        temperature_error_k: f64 = 0.0, -20.0..=20.0;
        /// Bias for an axis along the horizontal magnetic field of the Earth, °/h.
        magnetic_axial_deg_h: f64 = 0.0, -10.0..=10.0;
        /// Bias for an axis across it (the field 90° clockwise from the axis), °/h.
        magnetic_transverse_deg_h: f64 = 0.0, -10.0..=10.0;
        /// Biases that depend on the index angle.
        harmonics: Vec<Harmonic> = Vec::new(), Each;
        /// Transient after a move: bias left by 90° counter-clockwise, °/h; the other way has the other sign.
        after_move_deg_h: f64 = 0.0, -100.0..=100.0;
        /// Time in which it decays to 1/e, s.
        after_move_tau_s: f64 = 10.0, 0.1..=3600.0;
        /// Transient after a move by where it ends: this times cos(index angle − phase), °/h; it decays in the same time.
        arrival_deg_h: f64 = 0.0, -100.0..=100.0;
        /// Index angle at which that is greatest, degrees.
        arrival_phase_deg: f64 = 0.0, -360.0..=360.0;
        /// Vibration rectification, °/h per g².
        vibration_deg_h_per_g2: f64 = 0.0, -10000.0..=10000.0;
        /// Bias per g of specific force along the sensitive axis, °/h/g.
        g_sensitivity_deg_h_per_g: f64 = 0.0, -100.0..=100.0;
        /// Bias per volt of supply away from 12 V, °/h/V.
        supply_deg_h_per_v: f64 = 0.0, -100.0..=100.0;
        /// An effect that comes and goes (random telegraph): bias while it is on, °/h.
        intermittent_deg_h: f64 = 0.0, -1000.0..=1000.0;
        /// Mean time for which it is off, s.
        intermittent_off_s: f64 = 60.0, 0.01..=100000.0;
        /// Mean time for which it is on, s.
        intermittent_on_s: f64 = 10.0, 0.01..=100000.0;
        /// Interference: amplitude of a sinusoidal rate, °/h.
        interference_deg_h: f64 = 0.0, 0.0..=100000.0;
        /// Its frequency, Hz.
        interference_hz: f64 = 50.0, 0.001..=10000.0;
        /// Smallest step of the output angle, arcsec; what is cut off stays in the counter for the next frame.
        quantum_arcsec: f64 = 0.0005, 0.000001..=10.0;
        /// Largest rate, °/s; beyond it the output stays there with the status "saturated".
        full_scale_deg_s: f64 = 100.0, 0.001..=230.0;
        /// (KVH format A) It is set to rates instead of increments of angle, until a command changes that.
        rates: bool = false, Any;
        /// (KVH format A) It is set to degrees instead of radians, until a command changes that.
        degrees: bool = false, Any;
        /// (KVH format A) It is set to its own clock of 1000 Hz and hears no sync pulse, until a command changes that.
        own_clock: bool = false, Any;
        /// (KVH format A) It takes commands; else nothing leads to its receiver.
        listens: bool = true, Any;
        /// Frames for each 2.5 ms tick: 1 when the gyro obeys the sync pulse; 0.962 was seen on an internal clock.
        frames_per_tick: f64 = 1.0, 0.5..=2.0;
        /// Time after power-up before the first frame, s.
        startup_s: f64 = 0.0, 0.0..=600.0;
        /// Faults.
        faults: Vec<GyroFault> = Vec::new(), Each;
    }
}

//! Settings of the accelerometer, the encoder, the motor and the serial link.

use super::check::{Any, Choice, Each, part};
use serde::{Deserialize, Serialize};

/// What goes wrong with a sensor on the SPI bus in a window of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensorFaultKind {
    /// The reading no longer changes.
    Stuck,
    /// The data line is open: every byte reads FF.
    BusHigh,
    /// The data line is shorted: every byte reads 00.
    BusLow,
}

part! {
    /// A fault of a sensor.
    SensorFault {
        /// What goes wrong.
        kind: SensorFaultKind = SensorFaultKind::Stuck, Choice;
        /// Begins, s.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// The accelerometer triad (x forward, y left, z up).
    Accelerometer {
        /// Noise density, µg/√Hz.
        noise_ug_per_sqrt_hz: f64 = 22.5, 0.0..=100000.0;
        /// Bias of x, y and z, mg.
        bias_mg: [f64; 3] = [0.2, -0.2, 0.2], -500.0..=500.0;
        /// Scale error of x, y and z, parts per million.
        scale_ppm: [f64; 3] = [0.0; 3], -100000.0..=100000.0;
        /// Change of the biases with temperature, mg/K.
        bias_mg_per_k: [f64; 3] = [0.0; 3], -10.0..=10.0;
        /// Cross-axis sensitivity: part of y in x, of z in x, of z in y (rotation of the triad gives it too), ppm.
        cross_axis_ppm: [f64; 3] = [0.0; 3], -100000.0..=100000.0;
        /// Non-orthogonality: part of y in x, of z in x, of z in y, and not the other way round, ppm.
        skew_ppm: [f64; 3] = [0.0; 3], -100000.0..=100000.0;
        /// The factory has calibrated it: its calibration, with which it reads what it feels but for the errors above, is stored in the instrument.
        factory_calibrated: bool = true, Any;
        /// What the sensor's own test force adds to x, y and z, g.
        self_test_g: [f64; 3] = [0.3, 0.3, 1.5], -8.0..=8.0;
        /// Faults.
        faults: Vec<SensorFault> = Vec::new(), Each;
    }
}

/// What an analogue input carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AnalogueSource {
    /// Nothing: 0 V.
    Open,
    /// A thermometer of 0.5 V + 10 mV/°C at the housing.
    Housing,
    /// The same at the gyro.
    Gyro,
}

part! {
    /// The analogue inputs of the microcontroller.
    Analogue {
        /// What the first one carries.
        first: AnalogueSource = AnalogueSource::Open, Choice;
        /// The second one.
        second: AnalogueSource = AnalogueSource::Open, Choice;
        /// The third one.
        third: AnalogueSource = AnalogueSource::Open, Choice;
        /// The fourth one.
        fourth: AnalogueSource = AnalogueSource::Open, Choice;
    }
}

part! {
    /// The absolute encoder on the spindle, counter-clockwise positive.
    Encoder {
        /// Noise of a reading, degrees rms.
        noise_deg: f64 = 0.02, 0.0..=10.0;
        /// Amplitude of the once-per-turn error of an eccentric magnet, degrees.
        eccentricity_deg: f64 = 0.01, 0.0..=10.0;
        /// Angle at which that error is greatest, degrees.
        eccentricity_at_deg: f64 = 0.0, -360.0..=360.0;
        /// Zero error, degrees: the reading at the mark.
        zero_deg: f64 = 0.0, -180.0..=180.0;
        /// The magnet slips on its shaft by this angle, degrees …
        slip_deg: f64 = 0.0, -180.0..=180.0;
        /// … at this time, s.
        slip_at_s: f64 = 0.0, 0.0..=1e6;
        /// The magnet is too far away: diagnostics report a weak field.
        weak_magnet: bool = false, Any;
        /// Faults.
        faults: Vec<SensorFault> = Vec::new(), Each;
    }
}

part! {
    /// The index drive: a stepper, its gear and its load, as seen at the gyro.
    Motor {
        /// Index angle at the start, degrees.
        start_deg: f64 = 0.0, -360.0..=360.0;
        /// Angle of one microstep, degrees.
        microstep_deg: f64 = 0.01, 0.0001..=2.0;
        /// Greatest acceleration that the torque can give, °/s².
        max_acceleration_deg_s2: f64 = 3000.0, 1.0..=1e6;
        /// Frequency at which the rotor rings about its commanded angle, Hz.
        ringing_hz: f64 = 27.0, 0.5..=200.0;
        /// Damping ratio of that ringing; the damping is viscous, so that it also brakes a moving rotor.
        damping: f64 = 0.08, 0.0..=2.0;
        /// Dry friction, as the acceleration that it takes away, °/s².
        friction_deg_s2: f64 = 0.0, 0.0..=100000.0;
        /// Kick that the rotor gets, in its direction of travel, when the driver goes over to holding current 50 ms after
        /// the last step, °/s.
        kick_deg_s: f64 = 0.0, 0.0..=1000.0;
        /// Play between drive and gyro, degrees: the gyro follows when the play is used up.
        backlash_deg: f64 = 0.0, 0.0..=10.0;
        /// Unevenness of gear and microsteps: while it turns, the gyro's angle wanders about the even one by this, degrees rms, and forgets
        /// where it was in 0.05 s.
        unevenness_deg: f64 = 0.0, 0.0..=1.0;
        /// One of this many microsteps is lost; 0: none.
        lose_every: u32 = 0, 0..=1000000;
        /// Steps are lost from this time, s (a stalled drive); absent: never.
        stall_from_s: Option<f64> = None, 0.0..=1e6;
        /// The stall ends, s; absent: never.
        stall_to_s: Option<f64> = None, 0.0..=1e6;
        /// A hard stop: the rotor does not pass this angle counter-clockwise, degrees.
        hard_stop_deg: Option<f64> = None, -7200.0..=7200.0;
        /// The limit switch opens beyond this angle counter-clockwise, degrees; absent: it never does.
        limit_deg: Option<f64> = None, -7200.0..=7200.0;
        /// The gyro's spindle slips in its coupling by this angle, degrees …
        slip_deg: f64 = 0.0, -180.0..=180.0;
        /// … at this time, s.
        slip_at_s: f64 = 0.0, 0.0..=1e6;
        /// The holding servo hunts after the first move: amplitude at the rotor, degrees.
        hunting_deg: f64 = 0.0, 0.0..=5.0;
        /// Its frequency, Hz.
        hunting_hz: f64 = 1.37, 0.05..=50.0;
        /// The tripod gives way to the motor's torque: tilt in pitch and roll and twist in azimuth for each degree by which
        /// the rotor lags its commanded angle, arcsec/°.
        base_reaction_arcsec_per_deg: [f64; 3] = [1.0, -0.7, 4.0], -36000.0..=36000.0;
    }
}

/// What goes wrong on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LinkFaultKind {
    /// A byte is lost.
    Drop,
    /// A bit of the byte is inverted.
    Flip,
    /// The byte comes twice.
    Duplicate,
    /// The byte, and everything behind it, is held up.
    Delay,
    /// A run of bytes is replaced by random ones.
    Burst,
}

part! {
    /// A fault of the line.
    LinkFault {
        /// What goes wrong.
        kind: LinkFaultKind = LinkFaultKind::Drop, Choice;
        /// How often it begins, per byte.
        probability: f64 = 0.0, 0.0..=1.0;
        /// Length of a burst, or number of bytes dropped in a row.
        bytes: u32 = 1, 1..=100000;
        /// How long a delay lasts, s.
        delay_s: f64 = 0.01, 0.0..=10.0;
        /// Begins, s.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// The serial line from the gyro.
    Link {
        /// Bits per second; a byte takes ten.
        baud: u32 = 921_600, 9600..=10_000_000;
        /// Faults.
        faults: Vec<LinkFault> = Vec::new(), Each;
    }
}

//! Where the instrument stands and how its base moves.

use super::check::{Choice, Each, Inner, part};
use serde::{Deserialize, Serialize};

/// The angle of the base that a motion acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BaseAngle {
    /// Nose up is positive.
    Pitch,
    /// Left side up is positive.
    Roll,
    /// Azimuth of the mark, clockwise from above is positive.
    Azimuth,
}

part! {
    /// The place: latitude, heading of the mark, climate.
    Site {
        /// Geodetic latitude, degrees, north positive.
        latitude_deg: f64 = 34.75, -90.0..=90.0;
        /// Azimuth of the index-zero mark, degrees clockwise from true north.
        azimuth_deg: f64 = 40.0, -360.0..=360.0;
        /// Ambient temperature at the start, °C.
        ambient_c: f64 = 20.0, -60.0..=85.0;
        /// Steady change of the ambient temperature, K per hour.
        ambient_k_h: f64 = 0.0, -60.0..=60.0;
        /// Amplitude of a slow sinusoid in the ambient temperature (air conditioning, sun and clouds), K.
        ambient_wave_k: f64 = 0.0, 0.0..=30.0;
        /// Period of that sinusoid, s.
        ambient_wave_period_s: f64 = 600.0, 1.0..=86400.0;
        /// Magnetic declination: azimuth of magnetic north, degrees.
        magnetic_declination_deg: f64 = 0.0, -180.0..=180.0;
        /// Magnetic inclination: angle of the field below the horizon, degrees.
        magnetic_inclination_deg: f64 = 50.0, -89.0..=89.0;
    }
}

part! {
    /// A sinusoidal sway of one base angle.
    Sway {
        /// Which angle sways.
        angle: BaseAngle = BaseAngle::Pitch, Choice;
        /// Amplitude, arcsec.
        amplitude_arcsec: f64 = 0.0, 0.0..=36000.0;
        /// Frequency, Hz.
        frequency_hz: f64 = 1.0, 0.0001..=100.0;
        /// Phase at time 0, degrees.
        phase_deg: f64 = 0.0, -360.0..=360.0;
        /// Begins, s. It fades in and out over half a second, so that the attitude never jumps.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// Wind on the tripod: a random moment (first-order coloured) on an elastic, damped support.
    Wind {
        /// Standard deviation of the slow part of the tilt in pitch, arcsec.
        pitch_rms_arcsec: f64 = 0.0, 0.0..=3600.0;
        /// The same in roll, arcsec.
        roll_rms_arcsec: f64 = 0.0, 0.0..=3600.0;
        /// The same in azimuth, arcsec.
        azimuth_rms_arcsec: f64 = 0.0, 0.0..=3600.0;
        /// Correlation time of the gusts, s.
        gust_s: f64 = 2.0, 0.05..=600.0;
        /// Natural frequency of the support, Hz.
        support_hz: f64 = 5.3, 0.1..=30.0;
        /// Damping ratio of the support.
        support_damping: f64 = 0.05, 0.001..=2.0;
        /// Begins, s.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// A vehicle rocked by people who move: the load shifts at random times by random amounts.
    Rocking {
        /// Standard deviation of the tilt after a shift, in pitch, arcsec.
        pitch_rms_arcsec: f64 = 0.0, 0.0..=36000.0;
        /// The same in roll, arcsec.
        roll_rms_arcsec: f64 = 0.0, 0.0..=36000.0;
        /// Mean time between shifts, s (exponentially distributed).
        mean_interval_s: f64 = 8.0, 0.1..=3600.0;
        /// Natural frequency of the suspension, Hz.
        suspension_hz: f64 = 1.3, 0.1..=30.0;
        /// Damping ratio of the suspension.
        suspension_damping: f64 = 0.25, 0.001..=2.0;
        /// Begins, s.
        from_s: f64 = 0.0, 0.0..=1e6;
        /// Ends, s; absent: never.
        to_s: Option<f64> = None, 0.0..=1e6;
    }
}

part! {
    /// A shock: a decaying oscillation of the base and what stays of it.
    Shock {
        /// When, s.
        at_s: f64 = 0.0, 0.0..=1e6;
        /// First swing in pitch, roll and azimuth, arcsec.
        swing_arcsec: [f64; 3] = [0.0; 3], -36000.0..=36000.0;
        /// Change of pitch, roll and azimuth that stays, arcsec.
        permanent_arcsec: [f64; 3] = [0.0; 3], -36000.0..=36000.0;
        /// Frequency of the oscillation, Hz.
        frequency_hz: f64 = 6.3, 0.1..=100.0;
        /// Time in which it decays to 1/e, s.
        decay_s: f64 = 0.5, 0.01..=600.0;
    }
}

part! {
    /// The operator levels the instrument (or tilts it): pitch and roll go smoothly to new values.
    Relevel {
        /// When the operator starts, s.
        at_s: f64 = 0.0, 0.0..=1e6;
        /// How long it takes, s.
        duration_s: f64 = 5.0, 0.1..=3600.0;
        /// Pitch afterwards, degrees.
        pitch_deg: f64 = 0.0, -45.0..=45.0;
        /// Roll afterwards, degrees.
        roll_deg: f64 = 0.0, -45.0..=45.0;
    }
}

part! {
    /// The base: how it stands and how it moves. All motions add up.
    Base {
        /// Pitch at the start, degrees, nose up positive.
        pitch_deg: f64 = 0.05, -45.0..=45.0;
        /// Roll at the start, degrees, left side up positive.
        roll_deg: f64 = -0.08, -45.0..=45.0;
        /// Creep: total exponential settling in pitch, roll and azimuth, arcsec.
        creep_arcsec: [f64; 3] = [0.0; 3], -36000.0..=36000.0;
        /// Time constants of that settling, s.
        creep_tau_s: [f64; 3] = [300.0; 3], 1.0..=1e6;
        /// Steady creep in pitch, roll and azimuth, arcsec per second.
        creep_arcsec_s: [f64; 3] = [0.0; 3], -100.0..=100.0;
        /// Level of the vibration, g rms, broadband: seen by the accelerometers and rectified by the gyro.
        vibration_g: f64 = 0.0, 0.0..=10.0;
        /// Sinusoidal motions.
        sway: Vec<Sway> = Vec::new(), Each;
        /// Wind.
        wind: Wind = Wind::default(), Inner;
        /// Load that shifts at random.
        rocking: Rocking = Rocking::default(), Inner;
        /// Shocks.
        shocks: Vec<Shock> = Vec::new(), Each;
        /// Levelling by the operator, in order of time.
        relevel: Vec<Relevel> = Vec::new(), Each;
    }
}

part! {
    /// The supply voltage of the instrument.
    Supply {
        /// Voltage at the start, V. The gyro's bias is declared at 12 V.
        volts: f64 = 12.0, 5.0..=36.0;
        /// Steady change (a battery running down), V per hour.
        volts_h: f64 = 0.0, -20.0..=20.0;
        /// A step at a time, V.
        step_v: f64 = 0.0, -10.0..=10.0;
        /// The time of that step, s.
        step_at_s: f64 = 0.0, 0.0..=1e6;
    }
}

impl Supply {
    /// Voltage at a time, V.
    pub fn volts_at(&self, t_s: f64) -> f64 {
        let step_v = if t_s >= self.step_at_s { self.step_v } else { 0.0 };
        self.volts + self.volts_h * t_s / 3600.0 + step_v
    }
}

//! Every fault with its stable code, every doubt about an azimuth with its stable name, every counter.

use serde::{Deserialize, Serialize};

/// What ends a fix without an azimuth. The numbers are stable: they are on the link and in the manual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, defmt::Format)]
#[repr(u8)]
pub enum Fault {
    SettingsMissing = 1,
    SettingsCorrupt = 2,
    SettingsInvalid = 3,
    NearPole = 4,
    NotLevel = 10,
    Disturbed = 11,
    Jitter = 12,
    LevelLost = 13,
    MotorStall = 20,
    WrongAngle = 21,
    EncoderFailed = 22,
    AccelerometerFailed = 23,
    GyroSilent = 30,
    GyroInvalid = 31,
    GyroSaturated = 32,
    GyroClock = 33,
    GyroStuck = 35,
    LinkPoor = 34,
    OutOfTime = 40,
    Aborted = 41,
    Unsolvable = 42,
}

impl Fault {
    /// Lower-case name, stable.
    pub fn name(self) -> &'static str {
        match self {
            Self::SettingsMissing => "settings-missing",
            Self::SettingsCorrupt => "settings-corrupt",
            Self::SettingsInvalid => "settings-invalid",
            Self::NearPole => "near-pole",
            Self::NotLevel => "not-level-in-time",
            Self::Disturbed => "disturbed-too-long",
            Self::Jitter => "jitter-too-long",
            Self::LevelLost => "level-lost",
            Self::MotorStall => "motor-stall",
            Self::WrongAngle => "wrong-angle",
            Self::EncoderFailed => "encoder-failed",
            Self::AccelerometerFailed => "accelerometer-failed",
            Self::GyroSilent => "gyro-silent",
            Self::GyroInvalid => "gyro-invalid",
            Self::GyroSaturated => "gyro-saturated",
            Self::GyroClock => "gyro-clock",
            Self::GyroStuck => "gyro-stuck",
            Self::LinkPoor => "gyro-link-poor",
            Self::OutOfTime => "out-of-time",
            Self::Aborted => "aborted",
            Self::Unsolvable => "unsolvable",
        }
    }

    /// What happened, for a person.
    pub fn explain(self) -> &'static str {
        match self {
            Self::SettingsMissing => "no settings are stored: the latitude is not known",
            Self::SettingsCorrupt => "the stored settings fail their check: load them again",
            Self::SettingsInvalid => "the stored settings make no sense together: load corrected ones",
            Self::NearPole => "within 1 degree of a pole there is no horizontal Earth rate to find north by",
            Self::NotLevel => "the instrument was not levelled in time",
            Self::Disturbed => "the base did not come to rest before the time-out of the disturbance gate",
            Self::Jitter => "the rate did not come to rest after a move before the time-out of the jitter gate",
            Self::LevelLost => "the instrument left the level limit while measuring",
            Self::MotorStall => "the encoder does not follow the motor",
            Self::WrongAngle => "the encoder shows another angle than the commanded one after all retries",
            Self::EncoderFailed => "the encoder gives no valid or no changing reading",
            Self::AccelerometerFailed => "the accelerometer gives no valid or no changing reading",
            Self::GyroSilent => "no frame from the gyro",
            Self::GyroInvalid => "the gyro declares its data invalid",
            Self::GyroSaturated => "the gyro's rate is beyond its range",
            Self::GyroClock => "the gyro does not send 400 frames a second by the instrument's clock",
            Self::GyroStuck => "the gyro repeats the same increment",
            Self::LinkPoor => "too many seconds in a row lost too many frames",
            Self::OutOfTime => "the fix took longer than its time limit",
            Self::Aborted => "stopped by command",
            Self::Unsolvable => "the collected rates do not determine an azimuth",
        }
    }
}

/// A doubt that an azimuth carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, defmt::Format)]
#[repr(u8)]
pub enum Flag {
    /// No error model from a calibration is stored.
    Uncalibrated = 0,
    /// The disturbance gate had to wait.
    Disturbed = 1,
    /// The jitter gate had to wait.
    Jitter = 2,
    /// Seconds were left out of the solution because the rate jumped in them.
    Knocked = 3,
    /// Seconds were repaired or left out because frames were lost.
    FramesLost = 4,
    /// The base turned while measuring; the accelerometers' measure of it was taken out.
    BaseMotion = 5,
    /// The bias drifted more than declared; the drift was estimated.
    Drift = 6,
    /// The rates do not fit a level-plane sinusoid within their noise.
    Misfit = 7,
    /// The horizontal rate differs from Ω cos φ: wrong latitude, scale factor or a disturbed fix.
    Amplitude = 8,
    /// Tilt was not measured and is taken as zero.
    TiltUnknown = 9,
    /// The scatter is well above the declared noise.
    Noisy = 10,
    /// The temperature changed while measuring, and the error model does not cover it.
    Temperature = 11,
    /// The angles leave no redundancy: nothing would show an error.
    NoRedundancy = 12,
    /// The rate wanders inside the stays instead of scattering: something that is not white noise.
    Wandering = 13,
}

impl Flag {
    const ALL: [Flag; 14] = [
        Self::Uncalibrated,
        Self::Disturbed,
        Self::Jitter,
        Self::Knocked,
        Self::FramesLost,
        Self::BaseMotion,
        Self::Drift,
        Self::Misfit,
        Self::Amplitude,
        Self::TiltUnknown,
        Self::Noisy,
        Self::Temperature,
        Self::NoRedundancy,
        Self::Wandering,
    ];

    /// Lower-case name, stable.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uncalibrated => "uncalibrated",
            Self::Disturbed => "disturbed",
            Self::Jitter => "jitter",
            Self::Knocked => "knocked",
            Self::FramesLost => "frames-lost",
            Self::BaseMotion => "base-motion",
            Self::Drift => "drift",
            Self::Misfit => "misfit",
            Self::Amplitude => "amplitude",
            Self::TiltUnknown => "tilt-unknown",
            Self::Noisy => "noisy",
            Self::Temperature => "temperature",
            Self::NoRedundancy => "no-redundancy",
            Self::Wandering => "wandering",
        }
    }
}

/// A set of [`Flag`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, defmt::Format)]
pub struct Flags(u16);

impl Flags {
    pub fn insert(&mut self, flag: Flag) {
        self.0 |= 1 << flag as u8;
    }

    pub fn contains(self, flag: Flag) -> bool {
        self.0 & (1 << flag as u8) != 0
    }

    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL.into_iter().filter(move |&flag| self.contains(flag))
    }
}

/// Everything discarded or repaired since the start, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, defmt::Format)]
pub struct Counters {
    /// Good gyro frames.
    pub frames_good: u32,
    /// Frames whose check sum was wrong.
    pub frames_bad_crc: u32,
    /// Frames that the sequence numbers show to be missing.
    pub frames_lost: u32,
    /// Frames that came twice, or after their successors.
    pub frames_duplicate: u32,
    /// Frames that came, in order, after the tick by which they were due.
    pub frames_late: u32,
    /// Frames that the gyro itself marked as invalid or saturated.
    pub frames_invalid: u32,
    /// Bytes skipped in search of the next frame.
    pub bytes_skipped: u32,
    /// Bytes that the receive queue had no room for.
    pub bytes_refused: u32,
    /// Seconds with a few missing frames, repaired.
    pub seconds_repaired: u32,
    /// Seconds with too many missing frames, left out.
    pub seconds_left_out: u32,
    /// Seconds left out of a dwell because the rate jumped.
    pub seconds_knocked: u32,
    /// Accelerometer readings that failed.
    pub accelerometer_errors: u32,
    /// Encoder readings that failed (parity, error flag, bus).
    pub encoder_errors: u32,
    /// Sensor readings that the solve task had no room for.
    pub readings_refused: u32,
    /// Reports that the link had no room for.
    pub reports_refused: u32,
    /// Commands that could not be understood.
    pub commands_bad: u32,
}

/// What the queues between the board's tasks had no room for, since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refused {
    /// Bytes from the gyro.
    pub gyro_bytes: u32,
    /// Readings of a tick, for the solve task.
    pub readings: u32,
    /// Reports, for the link.
    pub reports: u32,
}

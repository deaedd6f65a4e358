//! What the instrument tells the outside: seconds, states, verdicts of the gates, fixes and faults.

pub mod bytes;
pub mod identity;
pub mod raw;
pub mod restart;
pub mod service;

use calibration::field::guidance::Guidance;
use calibration::field::problem::Solved;
use calibration::field::refusal::NoCalibration;
use serde::{Deserialize, Serialize};

pub use crate::fix::Fix;
use crate::fix::dwell::DwellSummary;
pub use crate::fix::heading::Heading;
use crate::health::{Counters, Fault, Finding, Refusal, Signal};
use crate::sensing::gates::Gate;
use crate::sensing::level::{LevelMoments, Tilt};
use bytes::{Bytes, Piece};
use identity::Identity;
use raw::Block;
use restart::{Crash, Text};

/// An event and when it happened.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Seconds since the first tick, by the instrument's clock.
    pub t_s: f64,
    pub event: Event,
}

/// The states of the instrument: those of a fix, in its order, and the calibration's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum State {
    /// Waiting for the command to start.
    Idle,
    /// Waiting until pitch and roll are inside the level limit.
    Levelling,
    /// The disturbance gate: is the base still enough to begin?
    Watching,
    /// The motor turns the gyro to a position.
    Indexing,
    /// The jitter gate: has the gyro come to rest after the move?
    Settling,
    /// One-second rates enter the solution.
    Collecting,
    /// The azimuth is out, or the calibration is stored.
    Finished,
    /// A fault ended the fix, or the calibration came to nothing.
    Failed,
    /// The accelerometers are being calibrated.
    Calibrating,
}

impl State {
    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Levelling => "levelling",
            Self::Watching => "watching",
            Self::Indexing => "indexing",
            Self::Settling => "settling",
            Self::Collecting => "collecting",
            Self::Finished => "finished",
            Self::Failed => "failed",
            Self::Calibrating => "calibrating",
        }
    }
}

/// Analogue channels: four inputs, the supply, the chip's temperature.
pub const AUXILIARY: usize = 6;
/// What they read over a second, each in its own unit; `None`: it has no name, or was not read.
pub type Auxiliary = [Option<f32>; AUXILIARY];

/// One second of measuring, whatever the state: all that a fix uses of it, so that a recording of these gives the same fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Second {
    /// End of the second, since switch-on. The seconds follow each other without a gap, whatever the delay of the reports.
    pub t_s: f64,
    /// Measured index angle, mean over the second, degrees counter-clockwise from above, in [0°, 360°); `None`: no valid
    /// reading.
    pub index_deg: Option<f64>,
    /// Gyro angle over the second as the gyro gave it, arcsec (so also its uncompensated mean rate in °/h).
    pub fog_arcsec: f64,
    /// First moment of that angle about the middle of the second, arcsec · s.
    pub moment_arcsec_s: f64,
    /// Mean rate over the second after the error model, °/h.
    pub rate_deg_h: f64,
    /// Gyro temperature, °C, if the gyro sends one.
    pub temp_c: Option<f64>,
    /// Temperature of the inertial block in the housing, °C, where there is one and it was read.
    pub block_temp_c: Option<f64>,
    /// The analogue channels.
    pub auxiliary: Auxiliary,
    /// Level accelerometers, mean and first moment over the second; `None`: no valid reading.
    pub level: Option<LevelMoments>,
    /// Their temperature, °C, where they have a thermometer and `level` is there.
    pub level_temp_c: Option<f64>,
    /// Frames of this second that never came or were not valid: the mean rate of the others stands in for them.
    pub lost_frames: u16,
    /// Number of the dwell, from 0, that was under way; from 128 on those of the passes of a continuous rotation.
    pub dwell: Option<u8>,
    /// Whether the second entered the solution.
    pub collected: bool,
    /// The gate that refused at the end of the second; or a doubt of the index, which is told once in a fix.
    pub waited_at: Option<Gate>,
}

/// A finished dwell at one position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dwell {
    /// Number of the position in the sequence, from 0.
    pub position: u8,
    /// Mean measured index angle, degrees.
    pub index_deg: f64,
    /// Measuring time that entered the solution, seconds.
    pub seconds: f64,
    /// Mean rate, °/h.
    pub rate_deg_h: f64,
    /// Standard deviation of that mean, from the scatter of its seconds, °/h.
    pub sigma_deg_h: f64,
}

impl Dwell {
    /// Of the position of this number, from 0.
    pub fn new(position: u8, summary: &DwellSummary) -> Self {
        Self {
            position,
            index_deg: summary.index_deg(),
            seconds: summary.seconds,
            rate_deg_h: summary.rate.mean,
            sigma_deg_h: summary.sigma_deg_h(),
        }
    }
}

/// All that the instrument can say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The sequencer entered a state.
    State(State),
    /// Level state while levelling: pitch and roll in degrees, and whether both are inside the limit.
    Level { tilt: Tilt, level: bool },
    /// Disturbance gate: the rate exceeded what a still gyro can read for the set number of seconds. w0 in °/h.
    Disturbed { excess_deg_h: f64 },
    /// Disturbance gate: passed.
    Undisturbed { excess_deg_h: f64 },
    /// The motor starts towards a position.
    Moving { position: u8, target_deg: f64 },
    /// The encoder confirms the position.
    Arrived { position: u8, index_deg: f64 },
    /// Jitter gate: successive rates differed too much for the set number of seconds. wp in °/h.
    Jitter { position: u8, change_deg_h: f64 },
    /// Jitter gate: passed, collecting begins.
    Settled { position: u8 },
    /// A second of measuring.
    Second(Second),
    /// A finished dwell at a position.
    Dwell(Dwell),
    /// The coarse azimuth that the east-west refinement steers by, degrees.
    Coarse { azimuth_deg: f64, sigma_deg: f64 },
    /// The azimuth.
    Fix(Fix),
    /// A fault ended the fix; `state` is where it happened.
    Fault { fault: Fault, state: State },
    /// Counters of everything discarded or repaired.
    Health(Counters),
    /// Calibrating: what the operator shall do.
    Guidance(Guidance),
    /// Calibrating: what was found on board, before and after.
    Calibration(Solved),
    /// The calibration of the accelerometers is in flash and in effect.
    CalibrationStored,
    /// Calibrating came to nothing; the calibration in use stays.
    NoCalibration(NoCalibration),
    /// The first after a start that a crash led to: what is known of it.
    Crash(Crash),
    /// What the board says of itself: CRC-32 of its program, the most of the stack that was ever used, and the longest time from a
    /// tick to the end of its work, thousandths of a tick.
    Vitals { program: u32, stack_bytes: u32, load_permille: u32 },
    /// The index angle changed while the motor stood; it was `before_deg`, degrees in [0°, 360°), and the fix goes on.
    IndexSlipped { position: u8, before_deg: f64 },
    /// The settings of a request are in flash; the instrument starts anew with them.
    SettingsStored,
    /// A value of the settings that came is not allowed; the first eight are told.
    Violation { field: Text, value: f64 },
    /// The heading as it is held since the last fix, once a second.
    Heading(Heading),
    /// The answer to the request of this number, after whatever it asked for; `None`: it is done. Number 0: to a frame that could
    /// not be read.
    Answer { number: u8, refusal: Option<Refusal> },
    /// Which firmware this is, on request.
    Identity(Identity),
    /// A piece of the settings in flash, on request.
    Settings(Piece),
    /// All that entered the instrument, on request.
    Raw(Block),
    /// An adaptive fix ends in so many seconds, if its sigma is small enough then; or a continuous rotation does.
    ToGo { seconds: f64 },
    /// What the instrument's test of itself found of an item: at the start, and on request.
    SelfTest(Finding),
    /// An adaptive fix goes on with the mirrored four positions, with dwells of so many seconds: those so far contradict each other, show
    /// no azimuth, or the index slipped.
    FallenBack { dwell_s: u16 },
    /// Records of the log of fixes, on request, and the place of the next one; none: it ends here.
    Log { next: u32, bytes: Bytes },
    /// The error model may no longer hold: the signal that moved, and the statistic of the watch.
    ModelAged { signal: Signal, statistic: f32 },
    /// A challenge, on request.
    Challenge { bytes: [u8; 24] },
}

impl Event {
    /// It tells of the board that runs the firmware, and not of the instrument: a process of a host tells otherwise, or nothing.
    pub fn is_of_board(&self) -> bool {
        match self {
            Self::Vitals { .. } => true,
            Self::SelfTest(finding) => finding.item.is_of_board(),
            _ => false,
        }
    }

    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::State(state) => state.name(),
            Self::Level { level: true, .. } => "level",
            Self::Level { level: false, .. } => "not-level",
            Self::Disturbed { .. } => "disturbed",
            Self::Undisturbed { .. } => "undisturbed",
            Self::Moving { .. } => "moving",
            Self::Arrived { .. } => "arrived",
            Self::Jitter { .. } => "jitter",
            Self::Settled { .. } => "settled",
            Self::Second(_) => "second",
            Self::Dwell(_) => "dwell",
            Self::Coarse { .. } => "coarse",
            Self::Fix(_) => "fix",
            Self::Fault { fault, .. } => fault.name(),
            Self::Health(_) => "health",
            Self::Guidance(guidance) => guidance.step.name(),
            Self::Calibration(_) => "calibration",
            Self::CalibrationStored => "calibration-stored",
            Self::NoCalibration(reason) => reason.why.name(),
            Self::Crash(crash) => crash.cause.name(),
            Self::Vitals { .. } => "vitals",
            Self::IndexSlipped { .. } => "index-slipped",
            Self::SettingsStored => "settings-stored",
            Self::Heading(_) => "heading",
            Self::Violation { .. } => "violation",
            Self::Answer { refusal: None, .. } => "done",
            Self::Answer { refusal: Some(refusal), .. } => refusal.name(),
            Self::Identity(_) => "identity",
            Self::Settings(_) => "settings",
            Self::Raw(_) => "raw",
            Self::ToGo { .. } => "to-go",
            Self::SelfTest(_) => "self-test",
            Self::FallenBack { .. } => "fallen-back",
            Self::Log { .. } => "log",
            Self::ModelAged { .. } => "model-aged",
            Self::Challenge { .. } => "challenge",
        }
    }
}

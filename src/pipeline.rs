//! The one way from bytes and time to an azimuth.

use crate::event::Report;
use crate::health::Fault;
use crate::settings::{Settings, store::Loaded};

/// What the sensors gave at one tick (every 2.5 ms).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Number of the tick, from 0; its time is `tick · 2.5 ms`.
    pub tick: u64,
    /// Specific force, g, x forward, y left, z up, where the accelerometer was due; `Some(None)`: due and failed.
    pub acceleration_g: Option<Option<[f64; 3]>>,
    /// Index angle, degrees, where the encoder was due; `Some(None)`: due and failed.
    pub index_deg: Option<Option<f64>>,
    /// Whether the step generator is running.
    pub turning: bool,
    /// Gyro bytes that the receive queue had no room for, since the start.
    pub bytes_refused: u32,
}

/// What the motor shall do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotorCommand {
    /// Turn by this many microsteps, counter-clockwise positive.
    Turn { microsteps: i32 },
    /// Stop where it is.
    Stop,
}

/// What an operator can ask for.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum Command {
    /// Begin a fix (again).
    Start,
    /// End the fix; the motor stops.
    Abort,
}

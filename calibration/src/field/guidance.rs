//! What the operator is told.

use serde::{Deserialize, Serialize};

use crate::ellipsoid::coverage::Direction;

/// What there is to do, or what was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Step {
    /// Turn the instrument to another attitude.
    Turn,
    /// It is at rest: hold still, it is being measured.
    Hold,
    /// The attitude is accepted.
    Accepted,
    /// It is at rest in a direction that has been measured already: turn it further.
    Known,
    /// It moved before it was measured: put it down again.
    Moved,
    /// What the accelerometers read at rest is not gravity.
    NotGravity,
    /// That was all: the calibration is being solved.
    Solving,
}

impl Step {
    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Turn => "turn",
            Self::Hold => "hold-still",
            Self::Accepted => "attitude-accepted",
            Self::Known => "attitude-known",
            Self::Moved => "moved",
            Self::NotGravity => "not-gravity",
            Self::Solving => "solving",
        }
    }
}

/// Where the operator stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Guidance {
    pub step: Step,
    /// Attitudes accepted so far.
    pub attitudes: u8,
    /// How well they cover the sphere, 0 … 1.
    pub coverage: f64,
    /// Which way of the instrument should point up next: of the directions not measured yet the one that is known worst.
    pub next: Direction,
}

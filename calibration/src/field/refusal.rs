//! Why a calibration in the field came to nothing.

use serde::{Deserialize, Serialize};

use crate::ellipsoid::Refusal;
use crate::ellipsoid::coverage::Direction;

/// The reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Why {
    TooFew,
    DirectionsMissing,
    MovingThroughout,
    NoEllipsoid,
    TooNoisy,
    /// A value is outside what a triad can have.
    Implausible,
    /// The attitudes held out do not show that it is better.
    NotBetter,
    NotStored,
    AccelerometerFailed,
    Aborted,
}

impl Why {
    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::TooFew => "too-few-attitudes",
            Self::DirectionsMissing => "directions-missing",
            Self::MovingThroughout => "moving-throughout",
            Self::NoEllipsoid => "not-an-ellipsoid",
            Self::TooNoisy => "too-noisy",
            Self::Implausible => "implausible",
            Self::NotBetter => "not-better",
            Self::NotStored => "not-stored",
            Self::AccelerometerFailed => "accelerometer-failed",
            Self::Aborted => "aborted",
        }
    }

    /// What happened, for a person.
    pub fn explain(self) -> &'static str {
        match self {
            Self::TooFew => "too few attitudes were measured",
            Self::DirectionsMissing => "the attitudes do not cover the sphere",
            Self::MovingThroughout => "the instrument never came to rest",
            Self::NoEllipsoid => "the readings do not lie on an ellipsoid",
            Self::TooNoisy => "the readings are too noisy",
            Self::Implausible => "what was found is not what an accelerometer triad can have",
            Self::NotBetter => "the attitudes held out do not show that it is better than the calibration in use",
            Self::NotStored => "the flash did not take it",
            Self::AccelerometerFailed => "the accelerometer gives no valid reading",
            Self::Aborted => "stopped by command",
        }
    }
}

/// The reason, and where it is a direction, which: the calibration in use stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NoCalibration {
    pub why: Why,
    /// The direction, pointing up, that is missing most.
    pub missing: Option<Direction>,
}

impl From<Why> for NoCalibration {
    fn from(why: Why) -> Self {
        Self { why, missing: None }
    }
}

impl From<Refusal> for NoCalibration {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::TooFew { .. } => Why::TooFew.into(),
            Refusal::Coverage { missing: [missing, ..], .. } => Self { why: Why::DirectionsMissing, missing },
            Refusal::NoEllipsoid | Refusal::Elongated { .. } | Refusal::Residual { .. } => Why::NoEllipsoid.into(),
            Refusal::TooNoisy { .. } => Why::TooNoisy.into(),
        }
    }
}

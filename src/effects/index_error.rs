//! The encoder: what the index angle reads wrongly.

use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

use crate::sensing::index::Direction;
use crate::units::sin_cos_deg;

/// The index angle reads too large by offset + cos_deg · cos θ + sin_deg · sin θ, degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IndexError {
    pub offset_deg: f64,
    pub cos_deg: f64,
    pub sin_deg: f64,
}

impl IndexError {
    /// True direction of the index from the measured one.
    pub fn true_index(&self, measured: Direction) -> Direction {
        let Direction { cos, sin } = measured;
        let error_deg = self.offset_deg + self.periodic_deg(measured);
        if error_deg == 0.0 {
            return measured;
        }
        // θ true = θ measured − error.
        let (s, c) = sin_cos_deg(error_deg);
        Direction { cos: cos * c + sin * s, sin: sin * c - cos * s }
    }

    /// The part of the error that changes over a turn: cos_deg · cos θ + sin_deg · sin θ, degrees.
    pub fn periodic_deg(&self, measured: Direction) -> f64 {
        self.cos_deg * measured.cos + self.sin_deg * measured.sin
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        within("model.index_error.offset_deg", self.offset_deg, -360.0, 360.0, "-360 to 360")?;
        let within_limit = |value: f64| within("model.index_error", value, -10.0, 10.0, "-10 to 10");
        [self.cos_deg, self.sin_deg].into_iter().try_for_each(within_limit)
    }
}

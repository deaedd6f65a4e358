//! A sinusoidal disturbance that begins with the recording, always with the same phase.

use core::f64::consts::TAU;

use quantities::limits::{Invalid, positive};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};

/// cos(2πt/period) and sin(2πt/period), t since switch-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Seconds, above 0. Of full precision: over an hour the phase counts.
    pub period_s: f64,
}

impl Functions for Line {
    fn count(&self) -> usize {
        2
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        let phase = TAU * now.conditions.t_s / self.period_s;
        Ok(values_of([libm::cos(phase), libm::sin(phase)]))
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.terms.basis.line.period_s", self.period_s)
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        &["cos_deg_h", "sin_deg_h"]
    }

    fn constant(&self) -> Option<(&'static str, f64)> {
        Some(("period_s", self.period_s))
    }

    fn set_constant(&mut self, value: f64) {
        self.period_s = value;
    }

    fn words(&self) -> &'static str {
        "a sinusoidal disturbance with the same phase after every switch-on"
    }
}

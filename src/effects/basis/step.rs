//! A step of the bias, always at the same time after switch-on.

use quantities::limits::{Invalid, finite};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};

/// 0 before, 1 after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Seconds since switch-on.
    pub t_s: f64,
}

impl Functions for Step {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        // The share of the second that lies after the step.
        let after = (now.conditions.t_s - self.t_s) / now.conditions.seconds.max(f64::MIN_POSITIVE) + 0.5;
        Ok(values_of([after.clamp(0.0, 1.0)]))
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.terms.basis.step.t_s", &[self.t_s])
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        &["deg_h"]
    }

    fn constant(&self) -> Option<(&'static str, f64)> {
        Some(("t_s", self.t_s))
    }

    fn set_constant(&mut self, value: f64) {
        self.t_s = value;
    }

    fn words(&self) -> &'static str {
        "a step of the bias at the same time after every switch-on"
    }
}

//! Warm-up: what dies away after switch-on.

use quantities::limits::{Invalid, positive};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};

/// exp(−t/τ), t since switch-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarmUp {
    /// Seconds, above 0.
    pub tau_s: f32,
}

impl Functions for WarmUp {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        Ok(values_of([libm::exp(-now.conditions.t_s.max(0.0) / f64::from(self.tau_s))]))
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.terms.basis.warm-up.tau_s", self.tau_s.into())
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        &["deg_h"]
    }

    fn constant(&self) -> Option<(&'static str, f64)> {
        Some(("tau_s", self.tau_s.into()))
    }

    fn set_constant(&mut self, value: f64) {
        self.tau_s = value as f32;
    }

    fn words(&self) -> &'static str {
        "bias that dies away after switch-on"
    }
}

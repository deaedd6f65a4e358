//! A sinusoidal disturbance whose phase is another in every fix: the solution estimates its parts.

use quantities::limits::{Invalid, positive};
use serde::{Deserialize, Serialize};

/// What is known of it beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sinusoid {
    /// Seconds, above 0.
    pub period_s: f64,
    /// Typical amplitude, °/h, above 0.
    pub amplitude_deg_h: f64,
}

impl Sinusoid {
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("model.sinusoid.period_s", self.period_s)?;
        positive("model.sinusoid.amplitude_deg_h", self.amplitude_deg_h)
    }
}

//! Drift: powers of the time since switch-on.

use core::fmt;

use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};

/// t, t² … in hours since switch-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Highest power, 1 … 3.
    pub degree: u8,
}

impl Functions for Drift {
    fn count(&self) -> usize {
        self.degree.into()
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        let hours = now.conditions.t_s / 3600.0;
        Ok(values_of((1..=self.degree).scan(1.0, |power, _| {
            *power *= hours;
            Some(*power)
        })))
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.terms.basis.drift.degree", self.degree.into(), 1.0, 3.0, "1 to 3")
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        &["deg_h_per_h", "deg_h_per_h2", "deg_h_per_h3"]
    }

    fn words(&self) -> &'static str {
        "bias that drifts with the time since switch-on"
    }
}

impl fmt::Display for Drift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.degree {
            1 => "drift",
            2 => "drift-quadratic",
            _ => "drift-cubic",
        })
    }
}

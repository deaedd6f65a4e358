//! Time of day.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Hours of Universal Time, 0 … 24 and beyond midnight on; the day is a circle of 24 hours for a harmonic of that period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hour;

impl SignalPart for Hour {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.run.hour_of_day.map(|hour| hour + now.conditions.t_s / 3600.0)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("hour")
    }

    fn unit(&self) -> &'static str {
        "h"
    }
}

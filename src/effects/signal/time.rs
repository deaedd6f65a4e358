//! Time since switch-on.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Middle of the second since switch-on, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Time;

impl SignalPart for Time {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.conditions.t_s)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("time")
    }

    fn unit(&self) -> &'static str {
        "s"
    }

    fn is_time(&self) -> bool {
        true
    }
}

//! The length of the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Degrees without sign; 0 before the first move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distance;

impl SignalPart for Distance {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.travel_deg.abs())
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("distance")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }
}

//! The length of the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Degrees without sign; before the first move it says nothing: what moves leave behind is not there yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distance;

impl SignalPart for Distance {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        (now.track.number > 0.0).then_some(now.track.travel_deg.abs())
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("distance")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }
}

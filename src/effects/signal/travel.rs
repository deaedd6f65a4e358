//! The way of the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Degrees, counter-clockwise positive; before the first move it says nothing: what moves leave behind is not there yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Travel;

impl SignalPart for Travel {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        (now.track.number > 0.0).then_some(now.track.travel_deg)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("travel")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }
}

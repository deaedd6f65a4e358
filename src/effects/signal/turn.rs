//! The direction of the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// 1 counter-clockwise, −1 clockwise; before the first move it says nothing: what moves leave behind is not there yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn;

impl SignalPart for Turn {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        (now.track.number > 0.0).then(|| libm::copysign(1.0, now.track.travel_deg))
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("turn")
    }

    fn unit(&self) -> &'static str {
        "1"
    }
}

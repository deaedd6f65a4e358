//! The direction of the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// 1 counter-clockwise, −1 clockwise, 0 before the first move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn;

impl SignalPart for Turn {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        let travel_deg = now.track.travel_deg;
        Some(if travel_deg == 0.0 { 0.0 } else { libm::copysign(1.0, travel_deg) })
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("turn")
    }

    fn unit(&self) -> &'static str {
        "1"
    }
}

//! The winding of the cable.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Unwrapped index angle, degrees counter-clockwise; the first of a recording is in [0°, 360°).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Winding;

impl SignalPart for Winding {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.winding_deg)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("winding")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }
}

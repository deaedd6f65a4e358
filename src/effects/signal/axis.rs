//! The direction of the sensitive axis over ground.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Azimuth of the sensitive axis, ψ − θ, degrees clockwise from north.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis;

impl SignalPart for Axis {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.belief.map(|belief| belief.axis_azimuth_deg)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("axis")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }

    fn is_angle(&self) -> bool {
        true
    }

    fn needs_azimuth(&self) -> bool {
        true
    }
}

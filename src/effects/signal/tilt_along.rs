//! Gravity along the sensitive axis.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Upward component of the sensitive axis, g: cos θ · forward + sin θ · left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TiltAlong;

impl SignalPart for TiltAlong {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        let (index, level) = (now.conditions.index?, now.conditions.level?);
        Some(index.cos * level.forward + index.sin * level.left)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("tilt-along")
    }

    fn unit(&self) -> &'static str {
        "g"
    }
}

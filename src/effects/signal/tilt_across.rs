//! Gravity across the sensitive axis.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Upward component of the horizontal axis 90° counter-clockwise of the sensitive one, g: cos θ · left − sin θ · forward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TiltAcross;

impl SignalPart for TiltAcross {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        let (index, level) = (now.conditions.index?, now.conditions.level?);
        Some(index.cos * level.left - index.sin * level.forward)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("tilt-across")
    }

    fn unit(&self) -> &'static str {
        "g"
    }
}

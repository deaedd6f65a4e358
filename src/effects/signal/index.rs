//! The index angle.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Index angle θ of the sensitive axis, degrees counter-clockwise from the mark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Index;

impl SignalPart for Index {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.conditions.index.map(|index| index.deg())
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("index")
    }

    fn unit(&self) -> &'static str {
        "deg"
    }

    fn is_angle(&self) -> bool {
        true
    }
}

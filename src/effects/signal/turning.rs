//! The turning rate of the index.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// °/s, counter-clockwise positive. Behind a low-pass: what every move leaves, by its signed way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turning;

impl SignalPart for Turning {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.turning_deg_s)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("turning")
    }

    fn unit(&self) -> &'static str {
        "deg/s"
    }
}

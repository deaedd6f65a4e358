//! The speed of the index.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// °/s without sign. Behind a low-pass: what every move leaves, by its length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed;

impl SignalPart for Speed {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.turning_deg_s.abs())
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("speed")
    }

    fn unit(&self) -> &'static str {
        "deg/s"
    }
}

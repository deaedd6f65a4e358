//! The moves as events.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Moves that began, by second. Behind a low-pass: what every move leaves, each as much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moves;

impl SignalPart for Moves {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.begun_per_s)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("moves")
    }

    fn unit(&self) -> &'static str {
        "1/s"
    }
}

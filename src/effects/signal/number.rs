//! The number of moves.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// How many moves were made, 0 before the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Number;

impl SignalPart for Number {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.number)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("number")
    }

    fn unit(&self) -> &'static str {
        "1"
    }
}

//! The rate as it was measured: what the gyro remembers of it.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Rate as the gyro gave it in the last second at rest, °/h: behind a dynamics, what the gyro remembers of rates before this one. Without a
/// dynamics it would explain every measurement trivially.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured;

impl SignalPart for Measured {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.rate_deg_h)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("measured")
    }

    fn unit(&self) -> &'static str {
        "deg/h"
    }

    fn needs_dynamics(&self) -> bool {
        true
    }
}

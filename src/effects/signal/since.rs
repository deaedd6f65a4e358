//! Time since the last move.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Seconds since the index came to rest; before the first move since the recording began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Since;

impl SignalPart for Since {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        Some(now.track.since_s)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("since")
    }

    fn unit(&self) -> &'static str {
        "s"
    }

    fn is_time(&self) -> bool {
        true
    }
}

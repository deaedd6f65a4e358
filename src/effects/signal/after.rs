//! Time since the last move, where there was one.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Seconds since the index came to rest; before the first move it says nothing: what moves leave behind is not there yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct After;

impl SignalPart for After {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        (now.track.number > 0.0).then_some(now.track.since_s)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("after")
    }

    fn unit(&self) -> &'static str {
        "s"
    }

    fn is_time(&self) -> bool {
        true
    }
}

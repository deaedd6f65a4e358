//! Rest before the run.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// Decimal logarithm of the seconds without power before the run: what cools, cools over decades of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest;

impl SignalPart for Rest {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.run.rest_s.map(|rest_s| libm::log10(rest_s.max(1.0)))
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("rest")
    }

    fn unit(&self) -> &'static str {
        "log s"
    }
}

//! The true rate itself.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::now::Now;

/// True rate about the sensitive axis, °/h: what the gyro makes of it beyond its scale factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate;

impl SignalPart for Rate {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.belief.map(|belief| belief.rate_deg_h)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("rate")
    }

    fn unit(&self) -> &'static str {
        "deg/h"
    }

    fn needs_azimuth(&self) -> bool {
        true
    }
}

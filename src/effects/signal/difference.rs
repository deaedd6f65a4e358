//! The difference of two channels: a gradient between two thermometers is one signal.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::channel::ChannelName;
use crate::effects::now::Now;

/// `plus` less `minus`, which are of one unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    pub plus: ChannelName,
    pub minus: ChannelName,
}

impl SignalPart for Difference {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        let value = |name| now.conditions.value(name, now.channels);
        Some(value(&self.plus)? - value(&self.minus)?)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-less-{}", self.plus.as_str(), self.minus.as_str())
    }

    fn unit(&self) -> &'static str {
        "unit"
    }

    fn channels(&self) -> [Option<&ChannelName>; 2] {
        [Some(&self.plus), Some(&self.minus)]
    }
}

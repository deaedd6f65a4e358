//! A channel of the recording.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::channel::ChannelName;
use crate::effects::now::Now;

/// What a channel reads, in its own unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    pub name: ChannelName,
}

impl SignalPart for Channel {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        now.conditions.value(&self.name, now.channels)
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name.as_str())
    }

    fn unit(&self) -> &'static str {
        "unit"
    }

    fn channels(&self) -> [Option<&ChannelName>; 2] {
        [Some(&self.name), None]
    }
}

//! A weighted difference of two channels, of whatever units: a bridge of two sensors that do not balance is one signal.

use core::fmt;

use quantities::limits::{Invalid, finite};
use serde::{Deserialize, Serialize};

use super::SignalPart;
use crate::effects::channel::ChannelName;
use crate::effects::now::Now;
use crate::effects::part::Constant;

/// `plus` less `ratio` times what `minus` deviates from `reference` by; a sum where `ratio` is negative.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedDifference {
    pub plus: ChannelName,
    pub minus: ChannelName,
    /// Units of `plus` per unit of `minus`.
    pub ratio: f32,
    /// In the unit of `minus`: the mean of what was learned from, so that another ratio leaves the values about where they were.
    pub reference: f32,
}

impl SignalPart for WeightedDifference {
    fn value(&self, now: &Now<'_>) -> Option<f64> {
        let value = |name| now.conditions.value(name, now.channels);
        Some(value(&self.plus)? - f64::from(self.ratio) * (value(&self.minus)? - f64::from(self.reference)))
    }

    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joined = if self.ratio < 0.0 { "and" } else { "less" };
        write!(f, "{}-{joined}-{}", self.plus.as_str(), self.minus.as_str())
    }

    fn unit(&self) -> &'static str {
        "unit"
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.signal.weighted-difference.ratio", &[self.ratio.into()])?;
        finite("model.effects.factors.signal.weighted-difference.reference", &[self.reference.into()])
    }

    fn channels(&self) -> [Option<&ChannelName>; 2] {
        [Some(&self.plus), Some(&self.minus)]
    }

    fn constant(&self) -> Option<Constant> {
        Some(Constant::place("ratio", self.ratio))
    }

    fn set(&mut self, value: f64) {
        self.ratio = value as f32;
    }
}

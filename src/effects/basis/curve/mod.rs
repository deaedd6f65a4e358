//! A curve in what a channel says: a signal that is made of the channel, and a function of that signal.

pub mod function;
pub mod signal;

use core::fmt;

use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values};
use crate::effects::channel::{ChannelName, TEMPERATURE};
use function::Function;
use signal::Signal;

/// A function of a signal of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    pub channel: ChannelName,
    pub signal: Signal,
    pub function: Function,
}

impl Functions for Curve {
    fn count(&self) -> usize {
        self.function.count()
    }

    fn values(&self, now: &Now<'_>, memory: &mut Option<f64>) -> Result<Values, Missing> {
        self.signal.at(&self.channel, now, memory).map(|signal| self.function.values(signal))
    }

    fn validate(&self) -> Result<(), Invalid> {
        self.signal.validate()?;
        self.function.validate()
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        let temperature = self.channel.as_str() == TEMPERATURE;
        match (&self.function, self.signal.is_rate(), temperature) {
            (Function::Spline(_), ..) => &["straight", "bend_1", "bend_2", "bend_3", "bend_4", "bend_5"],
            (Function::Table(_), ..) => &["at_1", "at_2", "at_3", "at_4", "at_5", "at_6", "at_7"],
            (_, true, true) => &["deg_h_per_k_per_s", "deg_h_per_k_per_s2", "deg_h_per_k_per_s3"],
            (_, true, false) => &["deg_h_per_unit_per_s", "deg_h_per_unit_per_s2", "deg_h_per_unit_per_s3"],
            (_, false, true) => &["deg_h_per_k", "deg_h_per_k2", "deg_h_per_k3"],
            (_, false, false) => &["deg_h_per_unit", "deg_h_per_unit2", "deg_h_per_unit3"],
        }
    }

    fn constant(&self) -> Option<(&'static str, f64)> {
        self.signal.constant()
    }

    fn set_constant(&mut self, value: f64) {
        self.signal.set_constant(value);
    }

    fn words(&self) -> &'static str {
        self.signal.words()
    }
}

/// "temperature" or "channel", then what is made of it where that is not the plain value, then the curve where it is not
/// straight.
impl fmt::Display for Curve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.channel.as_str() == TEMPERATURE { "temperature" } else { "channel" })?;
        self.signal.fmt(f)?;
        self.function.fmt(f)
    }
}

//! What is made of a channel before a curve: its value, an earlier one, a low-pass, a rate of change, a memory, a play.

use core::fmt;

use quantities::limits::{Invalid, positive, within};
use serde::{Deserialize, Serialize};

use super::super::{Missing, Now};
use crate::effects::channel::ChannelName;
use crate::effects::low_pass;

/// What is made of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Signal {
    Value,
    /// The value of so many seconds ago, 0 … 30.
    Lag {
        lag_s: f32,
    },
    /// What a first-order low-pass of that time constant makes of it; it starts at the first value.
    LowPass {
        tau_s: f32,
    },
    /// The value less that low-pass: what has not passed yet.
    Memory {
        tau_s: f32,
    },
    /// The rate of change over the last `samples` seconds (3 … 30), per second (Shupe, Applied Optics 19, 1980, p. 654): of a
    /// straight line, or, `curved`, of a parabola at its end. With `low_pass_s` above 0 that of the low-passed channel.
    Rate {
        samples: u8,
        curved: bool,
        low_pass_s: f32,
    },
    /// Hysteresis: a play of that half width follows the value (Krasnosel'skii and Pokrovskii, Systems with hysteresis,
    /// 1989); it starts at the first value.
    Play {
        half_width: f32,
    },
}

impl Signal {
    /// Its value now; `memory` is its own.
    pub fn at(&self, channel: &ChannelName, now: &Now<'_>, memory: &mut Option<f64>) -> Result<f64, Missing> {
        let Some(value) = now.conditions.value(channel, now.channels) else {
            *memory = None;
            return Err(if self.is_rate() { Missing::Waiting } else { Missing::Absent });
        };
        let window = || {
            let low_pass_s = self.window_low_pass_s()?;
            now.windows.iter().find(|window| window.is_of(channel, low_pass_s))
        };
        let mut passed = |tau_s: f32| {
            let passed = memory.map_or(value, |last| low_pass(last, value, now.step_s, tau_s.into()));
            *memory = Some(passed);
            passed
        };
        match *self {
            Self::Value => Ok(value),
            Self::Lag { lag_s } => window().and_then(|window| window.lagged(lag_s.into())).ok_or(Missing::Absent),
            Self::LowPass { tau_s } => Ok(passed(tau_s)),
            Self::Memory { tau_s } => Ok(value - passed(tau_s)),
            Self::Rate { samples, curved, .. } => {
                window().and_then(|window| window.rate(samples.into(), curved)).ok_or(Missing::Waiting)
            }
            Self::Play { half_width } => {
                let half = f64::from(half_width);
                let played = memory.unwrap_or(value).max(value - half).min(value + half);
                *memory = Some(played);
                Ok(played)
            }
        }
    }

    /// Time constant of the low-pass before the window of the past that it needs, seconds; `None`: it needs no window.
    pub fn window_low_pass_s(&self) -> Option<f32> {
        match *self {
            Self::Lag { .. } => Some(0.0),
            Self::Rate { low_pass_s, .. } => Some(low_pass_s),
            _ => None,
        }
    }

    pub fn is_rate(&self) -> bool {
        matches!(self, Self::Rate { .. })
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        match *self {
            Self::Value => Ok(()),
            Self::Lag { lag_s } => within("model.terms.basis.curve.signal.lag_s", lag_s.into(), 0.0, 30.0, "0 to 30"),
            Self::LowPass { tau_s } | Self::Memory { tau_s } => {
                positive("model.terms.basis.curve.signal.tau_s", tau_s.into())
            }
            Self::Rate { samples, low_pass_s, .. } => {
                within("model.terms.basis.curve.signal.samples", samples.into(), 3.0, 30.0, "3 to 30")?;
                let allowed = "0 (none) to 1000000";
                within("model.terms.basis.curve.signal.low_pass_s", low_pass_s.into(), 0.0, 1e6, allowed)
            }
            Self::Play { half_width } => positive("model.terms.basis.curve.signal.half_width", half_width.into()),
        }
    }

    /// Name and value of the parameter that it is not linear in.
    pub fn constant(&self) -> Option<(&'static str, f64)> {
        match *self {
            Self::Value => None,
            Self::Lag { lag_s } => Some(("lag_s", lag_s.into())),
            Self::LowPass { tau_s } | Self::Memory { tau_s } => Some(("tau_s", tau_s.into())),
            Self::Rate { low_pass_s, .. } if low_pass_s > 0.0 => Some(("tau_s", low_pass_s.into())),
            Self::Rate { samples, .. } => Some(("slope_s", samples.into())),
            Self::Play { half_width } => Some(("half_width", half_width.into())),
        }
    }

    pub fn set_constant(&mut self, value: f64) {
        match self {
            Self::Value => {}
            Self::Lag { lag_s } => *lag_s = value as f32,
            Self::LowPass { tau_s } | Self::Memory { tau_s } => *tau_s = value as f32,
            Self::Rate { low_pass_s, .. } if *low_pass_s > 0.0 => *low_pass_s = value as f32,
            Self::Rate { samples, .. } => *samples = libm::round(value).clamp(3.0, 30.0) as u8,
            Self::Play { half_width } => *half_width = value as f32,
        }
    }

    pub fn words(&self) -> &'static str {
        match self {
            Self::Value => "bias that follows a channel",
            Self::Lag { .. } => "bias that follows a channel some seconds later",
            Self::LowPass { .. } => "bias that follows a channel slowly",
            Self::Memory { .. } => "bias that remembers how a channel changed",
            Self::Rate { .. } => "bias that follows the rate of change of a channel",
            Self::Play { .. } => "bias that follows a channel with hysteresis",
        }
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Value => "",
            Self::Lag { .. } => "-lag",
            Self::LowPass { .. } => "-low-pass",
            Self::Memory { .. } => "-memory",
            Self::Rate { low_pass_s, .. } if *low_pass_s > 0.0 => "-rate-low-pass",
            Self::Rate { .. } => "-rate",
            Self::Play { .. } => "-hysteresis",
        })
    }
}

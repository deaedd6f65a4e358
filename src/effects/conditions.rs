//! What a second was like: all that effects can depend on.

use super::channel::{ChannelName, FORWARD, LEFT, MAX_CHANNELS, TEMPERATURE};
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;

/// A second, or a longer row of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Middle of the second since switch-on, and its length, seconds.
    pub t_s: f64,
    pub seconds: f64,
    /// Mean rate as the gyro gave it, °/h.
    pub raw_rate_deg_h: f64,
    /// Mean direction of the index.
    pub index: Option<Direction>,
    /// Gyro temperature, °C.
    pub temp_c: Option<f64>,
    /// Level accelerometers.
    pub level: Option<Specific>,
    /// Channels beyond these, in the order of [`super::ErrorModel::channels`]; not-a-number where absent.
    pub channels: [f64; MAX_CHANNELS],
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            t_s: 0.0,
            seconds: 1.0,
            raw_rate_deg_h: 0.0,
            index: None,
            temp_c: None,
            level: None,
            channels: [f64::NAN; MAX_CHANNELS],
        }
    }
}

impl Conditions {
    /// The value of a channel; `extra` are the names of [`Self::channels`].
    pub fn value(&self, name: &ChannelName, extra: &[ChannelName]) -> Option<f64> {
        let value = match name.as_str() {
            TEMPERATURE => self.temp_c,
            FORWARD => self.level.map(|level| level.forward),
            LEFT => self.level.map(|level| level.left),
            _ => extra.iter().zip(self.channels).find_map(|(each, value)| (each == name).then_some(value)),
        };
        value.filter(|value| value.is_finite())
    }

    /// Another value in the place of a channel's that has one; not-a-number: none. The levels are left as they are.
    pub fn replace(&mut self, name: &ChannelName, extra: &[ChannelName], value: f64) {
        if name.as_str() == TEMPERATURE {
            self.temp_c = Some(value).filter(|value| value.is_finite());
        } else if let Some((_, place)) = extra.iter().zip(&mut self.channels).find(|(each, _)| *each == name) {
            *place = value;
        }
    }
}

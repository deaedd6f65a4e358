//! Readings of a channel that can be.

use heapless::Vec;
use quantities::limits::{Invalid, finite, within};
use serde::{Deserialize, Serialize};

use super::MAX_WINDOWS;
use super::channel::{ChannelName, FORWARD, LEFT};
use super::conditions::Conditions;

/// A reading beyond this interval, in the channel's unit, is a fault of its sensor and no reading: the one before it holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plausible {
    pub channel: ChannelName,
    pub low: f64,
    pub high: f64,
}

impl Plausible {
    /// A finite interval of a channel that is no level.
    pub fn validate(&self) -> Result<(), Invalid> {
        finite("model.plausible.low", &[self.low])?;
        if matches!(self.channel.as_str(), FORWARD | LEFT) {
            return Err(Invalid::new("model.plausible (intervals of ax_g and ay_g)", 1.0, "0: the levels have none"));
        }
        within("model.plausible.high", self.high, self.low, f64::MAX, "at least as much as low")
    }
}

/// The last readings that could be, in the order of a model's intervals.
#[derive(Clone, Debug, Default)]
pub struct LastReadings(Vec<f64, MAX_WINDOWS>);

impl LastReadings {
    /// Puts the last reading that could be in the place of each that cannot; `extra` are the names of [`Conditions::channels`]. Before there is one, the
    /// channel has no reading.
    pub fn hold(&mut self, plausible: &[Plausible], extra: &[ChannelName], conditions: &mut Conditions) {
        for (i, Plausible { channel, low, high }) in plausible.iter().enumerate() {
            if self.0.len() <= i {
                let _ = self.0.push(f64::NAN);
            }
            let (Some(last), Some(value)) = (self.0.get_mut(i), conditions.value(channel, extra)) else { continue };
            if (*low..=*high).contains(&value) {
                *last = value;
            } else {
                conditions.replace(channel, extra, *last);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thermometer that says 85 °C when it has just got power, and −127 °C when its line is disturbed.
    #[test]
    fn the_last_reading_holds_by_hand() {
        let names = [ChannelName::new("housing_c").unwrap()];
        let plausible = [Plausible { channel: names[0], low: -40.0, high: 60.0 }];
        let mut last = LastReadings::default();
        let mut read = |value: f64| {
            let mut conditions = Conditions::default();
            conditions.channels[0] = value;
            last.hold(&plausible, &names, &mut conditions);
            conditions.value(&names[0], &names)
        };
        let readings = [85.0, 20.0, 85.0, -127.0, 21.0, 60.0];
        let expected = [None, Some(20.0), Some(20.0), Some(20.0), Some(21.0), Some(60.0)];
        assert_eq!(readings.map(&mut read), expected);
    }

    #[test]
    fn intervals_are_checked() {
        let of = |channel, low, high| Plausible { channel: ChannelName::new(channel).unwrap(), low, high }.validate();
        assert!(of("temp_c", -40.0, 60.0).is_ok());
        assert!(of("temp_c", 60.0, -40.0).is_err() && of("temp_c", f64::NAN, 1.0).is_err());
        assert!(of("temp_c", 0.0, f64::INFINITY).is_err() && of("ax_g", -1.0, 1.0).is_err());
    }
}

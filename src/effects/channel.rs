//! Channels that an effect can follow, by the name of their column in a recording.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Longest name, bytes.
pub const MAX_NAME: usize = 24;
/// Most channels beyond temperature and level that one model can follow.
pub const MAX_CHANNELS: usize = 8;

/// Gyro temperature.
pub const TEMPERATURE: &str = "temp_c";
/// Forward and left accelerometer.
pub const FORWARD: &str = "ax_g";
pub const LEFT: &str = "ay_g";
/// Their temperature, °C: what the fix reckons their drift by. No effect follows it.
pub const LEVEL_TEMPERATURE: &str = "level_temp_c";
/// Temperature of the inertial block in the housing, °C.
pub const BLOCK_TEMPERATURE: &str = "block_temp_c";
/// Supply voltage, V, and temperature of the microcontroller, °C.
pub const SUPPLY: &str = "supply_v";
pub const CHIP_TEMPERATURE: &str = "chip_temp_c";

/// A column's name, 1 to 24 bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ChannelName {
    bytes: [u8; MAX_NAME],
    length: u8,
}

impl ChannelName {
    /// `None` for an empty name and for one that is too long.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = [0; MAX_NAME];
        bytes.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        (!name.is_empty()).then_some(Self { bytes, length: name.len() as u8 })
    }

    pub fn as_str(&self) -> &str {
        self.bytes.get(..self.length.into()).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or_default()
    }

    /// Whether it is no further channel, but one that every second has.
    pub fn is_in_every_second(&self) -> bool {
        matches!(self.as_str(), TEMPERATURE | FORWARD | LEFT)
    }

    /// Whether a board measures it, which measures these channels beyond those of every second.
    pub fn is_on_board(&self, measured: &[Self]) -> bool {
        self.is_in_every_second() || measured.contains(self)
    }
}

impl fmt::Debug for ChannelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}

impl Serialize for ChannelName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for ChannelName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = ChannelName;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a channel's name of 1 to 24 bytes")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<ChannelName, E> {
                ChannelName::new(name).ok_or_else(|| E::invalid_value(de::Unexpected::Str(name), &self))
            }
        }
        deserializer.deserialize_str(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_or_are_refused() {
        assert_eq!(ChannelName::new("supply_v").unwrap().as_str(), "supply_v");
        assert_eq!(ChannelName::new("a_name_of_twenty_four_by").unwrap().as_str().len(), MAX_NAME);
        assert_eq!(ChannelName::new("a_name_of_twenty_five_byt"), None);
        assert_eq!(ChannelName::new(""), None);
        let supply = ChannelName::new("supply_v").unwrap();
        assert!(ChannelName::new("temp_c").unwrap().is_on_board(&[]));
        assert!(supply.is_on_board(&[supply]) && !supply.is_on_board(&[]));
    }
}

//! What is connected to the analogue inputs.

use heapless::Vec;
use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use crate::effects::ChannelName;
use crate::effects::channel::{
    BLOCK_TEMPERATURE, CHIP_TEMPERATURE, FORWARD, LEFT, LEVEL_TEMPERATURE, SUPPLY, TEMPERATURE,
};
use crate::event::AUXILIARY;

/// An input that something is connected to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputSettings {
    /// Column of recordings, and channel of the error model.
    pub name: ChannelName,
    /// What it reads is (voltage − `zero_v`) · `per_v`.
    #[serde(default)]
    pub zero_v: f64,
    #[serde(default = "one")]
    pub per_v: f64,
}

fn one() -> f64 {
    1.0
}

/// All of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AnalogueSettings {
    pub first: Option<InputSettings>,
    pub second: Option<InputSettings>,
    pub third: Option<InputSettings>,
    pub fourth: Option<InputSettings>,
    /// The supply over what its divider leaves of it.
    pub supply_ratio: f64,
}

impl Default for AnalogueSettings {
    /// 100 kΩ over 10 kΩ, of which 36 V make 3.27 V.
    fn default() -> Self {
        Self { first: None, second: None, third: None, fourth: None, supply_ratio: 11.0 }
    }
}

impl AnalogueSettings {
    pub fn inputs(&self) -> [Option<InputSettings>; 4] {
        [self.first, self.second, self.third, self.fourth]
    }

    /// Names of the channels, in the order of the inputs: those of the four that have one, the supply, the chip's temperature.
    pub fn names(&self) -> [Option<ChannelName>; AUXILIARY] {
        let [first, second, third, fourth] = self.inputs().map(|input| input.map(|input| input.name));
        [first, second, third, fourth, ChannelName::new(SUPPLY), ChannelName::new(CHIP_TEMPERATURE)]
    }

    /// What the names together must be.
    ///
    /// Errors: one that another channel of the board has, or the time, the angles.
    pub fn validate(&self) -> Result<(), Invalid> {
        const COLUMNS: [&str; 8] =
            [TEMPERATURE, FORWARD, LEFT, LEVEL_TEMPERATURE, BLOCK_TEMPERATURE, "t_s", "index_deg", "fog_arcsec"];
        const FIELDS: [&str; 4] =
            ["analogue.first.name", "analogue.second.name", "analogue.third.name", "analogue.fourth.name"];
        let mut seen: Vec<ChannelName, AUXILIARY> = Vec::new();
        // The board's own names first.
        for (number, name) in self.names().iter().enumerate().rev() {
            let Some(name) = name else { continue };
            if seen.contains(name) || COLUMNS.contains(&name.as_str()) {
                let field = FIELDS.get(number).copied().unwrap_or("analogue");
                return Err(Invalid::new(field, number as f64 + 1.0, "a name that no other channel has"));
            }
            let _ = seen.push(*name); // as many as there are names
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_another_channel_has_is_refused() {
        let named = |name| Some(InputSettings { name: ChannelName::new(name).unwrap(), zero_v: 0.0, per_v: 1.0 });
        let of = |first, second| AnalogueSettings { first, second, ..AnalogueSettings::default() };
        assert_eq!(of(named("field_ut"), named("pressure_hpa")).validate(), Ok(()));
        for (settings, field) in [
            (of(named("a"), named("a")), "analogue.first.name"),
            (of(None, named("supply_v")), "analogue.second.name"),
            (of(named("temp_c"), None), "analogue.first.name"),
        ] {
            assert_eq!(settings.validate().unwrap_err().field, field);
        }
    }
}

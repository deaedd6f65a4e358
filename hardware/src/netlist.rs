//! The netlist as it is written: parts, pins, nets.

use std::collections::BTreeMap;

use serde::Deserialize;

/// A supply or ground, by the name of its net.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rail {
    pub name: String,
    pub volts: f64,
    /// What it may be loaded with.
    pub limit_ma: Option<f64>,
    #[serde(default)]
    pub note: String,
}

/// What a pin does, seen from its part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    In,
    Out,
    Both,
    /// A supply or ground that the part takes.
    Rail,
    /// A supply or ground that the part gives.
    Source,
    Passive,
    /// Left unconnected, on purpose.
    Open,
}

/// A part, with its pins.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub name: String,
    /// Everything but the name is as of this part.
    pub like: Option<String>,
    #[serde(default)]
    pub what: String,
    #[serde(default)]
    pub value: String,
    /// A part that can be bought.
    #[serde(default)]
    pub usual: String,
    #[serde(default = "one")]
    pub quantity: u32,
    /// Where it is needed; `None`: always.
    pub optional: Option<String>,
    pub supply: Option<String>,
    pub volts: Option<[f64; 2]>,
    /// Typical and greatest.
    pub current_ma: Option<[f64; 2]>,
    /// The rail that it makes of its supply, as a switching regulator of this efficiency.
    pub feeds: Option<String>,
    pub efficiency: Option<f64>,
    /// Where the figures are from.
    #[serde(default)]
    pub source: String,
    #[serde(default)]
    pub pins: BTreeMap<String, Kind>,
    /// Numbers on the package, where the part is soldered as such.
    #[serde(default)]
    pub numbers: BTreeMap<String, Vec<u32>>,
}

fn one() -> u32 {
    1
}

/// A pin of a part: `U1.PA10`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(try_from = "String")]
pub struct Pin {
    pub part: String,
    pub pin: String,
}

impl TryFrom<String> for Pin {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let (part, pin) = text.split_once('.').ok_or_else(|| format!("{text:?} is not PART.PIN"))?;
        Ok(Self { part: part.into(), pin: pin.into() })
    }
}

/// Pins that are joined.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Net {
    pub name: String,
    pub pins: Vec<Pin>,
    /// What the microcontroller's pin is used for: a function of its data sheet, or `output`.
    pub function: Option<String>,
    #[serde(default)]
    pub why: String,
}

impl Net {
    /// The net's pins of a part.
    pub fn of<'a>(&'a self, part: &'a str) -> impl Iterator<Item = &'a str> {
        self.pins.iter().filter(move |pin| pin.part == part).map(|pin| pin.pin.as_str())
    }
}

/// What stands where in the diagram.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drawing {
    pub centre: String,
    /// Chains of parts from the outside to the centre.
    pub left: Vec<Vec<String>>,
    pub right: Vec<Vec<String>>,
    pub supply: Vec<String>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Netlist {
    #[serde(rename = "rail")]
    pub rails: Vec<Rail>,
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
    #[serde(rename = "net")]
    pub nets: Vec<Net>,
    pub drawing: Drawing,
}

/// The file is no netlist.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    #[error("part {part} is like {like}, which does not come before it")]
    Like { part: String, like: String },
}

impl Netlist {
    /// Reads the file's text; parts that are like others become whole.
    pub fn read(text: &str) -> Result<Self, ReadError> {
        let mut netlist: Self = toml::from_str(text)?;
        for number in 0..netlist.parts.len() {
            let (before, rest) = netlist.parts.split_at_mut(number);
            if let [part, ..] = rest
                && let Some(like) = part.like.clone()
            {
                let (name, found) = (part.name.clone(), before.iter().find(|other| other.name == like));
                *part = match found {
                    Some(other) => Part { name, like: Some(like), ..other.clone() },
                    None => return Err(ReadError::Like { part: name, like }),
                };
            }
        }
        Ok(netlist)
    }

    pub fn part(&self, name: &str) -> Option<&Part> {
        self.parts.iter().find(|part| part.name == name)
    }

    pub fn rail(&self, name: &str) -> Option<&Rail> {
        self.rails.iter().find(|rail| rail.name == name)
    }

    /// The nets that are no rails.
    pub fn signals(&self) -> impl Iterator<Item = &Net> {
        self.nets.iter().filter(|net| self.rail(&net.name).is_none())
    }

    /// The net that a pin is on.
    pub fn net_of(&self, part: &str, pin: &str) -> Option<&Net> {
        self.nets.iter().find(|net| net.of(part).any(|other| other == pin))
    }

    /// The parts with two passive pins that hang on a net by one of them: the part, and the net at its other end.
    pub fn hanging<'a>(&'a self, net: &'a Net) -> impl Iterator<Item = (&'a Part, &'a Net)> {
        net.pins.iter().filter_map(move |Pin { part, pin }| {
            let part = self.part(part).filter(|part| part.pins.len() == 2 && is_small(part))?;
            let other = part.pins.keys().find(|other| *other != pin)?;
            Some((part, self.net_of(&part.name, other)?))
        })
    }
}

/// Resistors and capacitors, which the diagram draws on their wires.
pub fn is_small(part: &Part) -> bool {
    matches!(part.what.as_str(), "resistor" | "capacitor")
}

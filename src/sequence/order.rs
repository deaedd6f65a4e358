//! Orders of positions: which index angles, one after the other.

use core::fmt;

use heapless::Vec;
use quantities::limits::{Invalid, within};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, IntoDeserializer, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::rotation;
use crate::sensing::index::{IndexSettings, TRAVEL_FROM_DEG};

/// Most positions that an order can have.
pub const MAX_POSITIONS: usize = 16;

/// An order of index positions. Angles in degrees, counter-clockwise from above, from the mark.
///
/// In a text the words `adaptive` and `rotation` alone stand for [`Order::ADAPTIVE`] and [`Order::ROTATION`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", remote = "Self")]
pub enum Order {
    /// 0, 90, 180, 270.
    Plain,
    /// 90, 180, 270, 360: as the published system turns.
    Source,
    /// 0, 90, 180, 270, 270, 180, 90, 0: a linear bias drift cancels.
    Mirrored,
    /// 0, 90, 180, 270 briefly, then east, west, west, east by the coarse azimuth: the axis where it is most sensitive.
    EastWest,
    /// Any angles; at least three that are different.
    Custom(Vec<f64, MAX_POSITIONS>),
    /// Two short dwells, then where the axis points east and west until the azimuth's standard deviation is no greater than this, or
    /// the time limit ends it: [`super::adaptive`].
    Adaptive {
        #[serde(default = "usual_accuracy_deg")]
        accuracy_deg: f64,
    },
    /// A continuous rotation to and fro over the travel of one turn, at the drive's speed, in so many passes: [`super::rotation`].
    Rotation {
        #[serde(default = "usual_passes")]
        passes: u8,
    },
}

/// As good as the mirrored order with dwells of 30 s at middle latitudes, in two thirds of its time.
const fn usual_accuracy_deg() -> f64 {
    0.04
}

/// As long as the mirrored order with dwells of 30 s: 20 passes of 13.3 s.
const fn usual_passes() -> u8 {
    20
}

impl Serialize for Order {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for Order {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match deserializer.is_human_readable() {
            true => deserializer.deserialize_any(WordOrTable),
            false => Self::deserialize(deserializer),
        }
    }
}

/// An order in a text.
struct WordOrTable;

impl<'de> Visitor<'de> for WordOrTable {
    type Value = Order;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of an order, or a table such as { adaptive = { accuracy_deg = 0.05 } }")
    }

    fn visit_str<E: de::Error>(self, word: &str) -> Result<Order, E> {
        match word {
            "adaptive" => Ok(Order::ADAPTIVE),
            "rotation" => Ok(Order::ROTATION),
            "custom" => Err(E::custom("the order custom needs its angles: { custom = [0.0, 120.0, 240.0] }")),
            word => Order::deserialize(word.into_deserializer()),
        }
    }

    fn visit_map<A: de::MapAccess<'de>>(self, table: A) -> Result<Order, A::Error> {
        Order::deserialize(MapAccessDeserializer::new(table))
    }
}

/// Which positions, in which order, for how long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SequenceSettings {
    pub order: Order,
    /// Measuring time at each position, seconds (for the east-west order: of each of its four long dwells).
    pub dwell_s: u16,
    /// Measuring time at each of the four positions of the east-west order's coarse pass, seconds.
    pub coarse_dwell_s: u16,
}

impl Default for SequenceSettings {
    fn default() -> Self {
        Self { order: Order::ADAPTIVE, dwell_s: 30, coarse_dwell_s: 10 }
    }
}

/// Where the next dwell is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Position {
    /// At this index angle, degrees.
    At {
        index_deg: f64,
        coarse: bool,
    },
    /// Where the sensitive axis points east (or west), once the coarse azimuth is known.
    East,
    West,
}

impl SequenceSettings {
    /// Measuring time that the order wants, seconds, of a rotation with its turning points; 0 where nobody knows it before.
    pub fn measuring_s(&self, index: &IndexSettings) -> f64 {
        if let Order::Rotation { passes } = self.order {
            return f64::from(passes) * rotation::pass_s(index);
        }
        let seconds = |number| match self.order.position(number) {
            Some(Position::At { coarse: true, .. }) => self.coarse_dwell_s,
            _ => self.dwell_s,
        };
        (0..self.order.len()).map(|number| f64::from(seconds(number))).sum()
    }
}

const PLAIN: [f64; 4] = [0.0, 90.0, 180.0, 270.0];
const SOURCE: [f64; 4] = [90.0, 180.0, 270.0, 360.0];
const MIRRORED: [f64; 8] = [0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0];
/// Passes of a continuous rotation: at least one to and one fro; their numbers go on from 128.
const PASSES: core::ops::RangeInclusive<u8> = 2..=120;
const EAST_WEST: [Position; 4] = [Position::East, Position::West, Position::West, Position::East];

impl Order {
    pub const ADAPTIVE: Self = Self::Adaptive { accuracy_deg: usual_accuracy_deg() };
    pub const ROTATION: Self = Self::Rotation { passes: usual_passes() };

    /// The standard deviation of the azimuth that is asked for, degrees, if one is.
    pub fn accuracy_deg(&self) -> Option<f64> {
        match *self {
            Self::Adaptive { accuracy_deg } => Some(accuracy_deg),
            _ => None,
        }
    }

    /// Number of dwells; 0 where nobody knows it before.
    pub fn len(&self) -> usize {
        match self {
            Self::EastWest => PLAIN.len() + EAST_WEST.len(),
            _ => self.angles_deg().len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The `number`-th dwell from 0; `None` past the last. A rotation begins at the travel's beginning.
    pub fn position(&self, number: usize) -> Option<Position> {
        if let Self::Rotation { .. } = self {
            return (number == 0).then_some(Position::At { index_deg: TRAVEL_FROM_DEG, coarse: false });
        }
        let coarse = matches!(self, Self::EastWest);
        self.angles_deg().get(number).map(|&index_deg| Position::At { index_deg, coarse }).or_else(|| {
            let refined = number.checked_sub(PLAIN.len()).filter(|_| coarse)?;
            EAST_WEST.get(refined).copied()
        })
    }

    /// Whether the drive can do it. Errors: a rotation whose passes would be ramps for the most part.
    pub fn validate_drive(&self, index: &IndexSettings) -> Result<(), Invalid> {
        let allowed = "so slow, for sequence.order rotation, that half of a pass and three seconds of it are even";
        match self {
            Self::Rotation { .. } if !rotation::is_even_enough(index) => {
                Err(Invalid::new("index.speed_deg_s", index.speed_deg_s, allowed))
            }
            _ => Ok(()),
        }
    }

    fn angles_deg(&self) -> &[f64] {
        match self {
            Self::Plain | Self::EastWest => &PLAIN,
            Self::Source => &SOURCE,
            Self::Mirrored => &MIRRORED,
            Self::Custom(angles) => angles,
            // One finds its own, the other has none.
            Self::Adaptive { .. } | Self::Rotation { .. } => &[],
        }
    }

    /// The adaptive order's accuracy lies within 0.001° to 10°; a rotation has an even number of passes, 2 to 120. Otherwise at least three directions at least 1° apart, all finite and within ± two turns.
    pub fn validate(&self) -> Result<(), Invalid> {
        if let Self::Adaptive { accuracy_deg } = *self {
            return within("sequence.order.adaptive.accuracy_deg", accuracy_deg, 0.001, 10.0, "0.001 to 10");
        }
        if let Self::Rotation { passes } = *self {
            let field = "sequence.order.rotation.passes";
            let allowed = PASSES.contains(&passes) && passes.is_multiple_of(2);
            return if allowed { Ok(()) } else { Err(Invalid::new(field, passes.into(), "an even number, 2 to 120")) };
        }
        let angles = self.angles_deg();
        for &value in angles {
            if !(-720.0..=720.0).contains(&value) {
                return Err(Invalid::new("sequence.order.custom", value, "-720 to 720"));
            }
        }
        let directions = angles.iter().enumerate().filter(|&(i, &angle)| {
            angles.iter().take(i).all(|&earlier| crate::units::wrap_180_deg(angle - earlier).abs() >= 1.0)
        });
        let count = directions.count();
        if count < 3 {
            return Err(Invalid::new("sequence.order.custom", count as f64, "at least 3 different directions"));
        }
        Ok(())
    }
}

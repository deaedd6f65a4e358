//! Settling: every move leaves something behind that dies away.

use core::fmt;

use quantities::limits::{Invalid, positive};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};
use crate::effects::moves::Move;

/// exp(−t/τ), t since the index came to rest, times a size; what is left of the last eight moves adds up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settling {
    /// Seconds, above 0.
    pub tau_s: f32,
    pub by: Size,
    /// Switch-on counts as a move too.
    pub first_dwell: bool,
}

/// What the size of a move's remainder depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// Every move leaves as much.
    Constant,
    /// The sign of the move, counter-clockwise positive.
    Direction,
    /// Its way in degrees, without and with sign.
    Travel,
    SignedTravel,
    /// Cosine and sine of the index angle that it led to.
    Position,
    /// How many moves were made with it, from 1; 0 for switch-on.
    Number,
}

impl Size {
    fn of(self, each: &Move) -> [f64; 2] {
        let travel_deg = f64::from(each.travel_deg);
        let [cos, sin] = each.index.map(f64::from);
        match self {
            Self::Constant => [1.0, 0.0],
            Self::Direction if each.travel_deg == 0.0 => [0.0; 2],
            Self::Direction => [libm::copysign(1.0, travel_deg), 0.0],
            Self::Travel => [travel_deg.abs(), 0.0],
            Self::SignedTravel => [travel_deg, 0.0],
            Self::Position => [cos, sin],
            Self::Number => [each.number.map_or(0.0, |before| f64::from(before) + 1.0), 0.0],
        }
    }
}

impl Functions for Settling {
    fn count(&self) -> usize {
        1 + usize::from(self.by == Size::Position)
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        let mut sum = [0.0; 2];
        for each in now.moves.iter().filter(|each| self.first_dwell || each.number.is_some()) {
            let left = libm::exp(-(now.conditions.t_s - each.ended_s).max(0.0) / f64::from(self.tau_s));
            for (sum, size) in sum.iter_mut().zip(self.by.of(each)) {
                *sum += left * size;
            }
        }
        Ok(values_of(sum.into_iter().take(self.count())))
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.terms.basis.settling.tau_s", self.tau_s.into())
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        match self.by {
            Size::Constant | Size::Direction => &["deg_h"],
            Size::Travel => &["deg_h_per_deg_travel"],
            Size::SignedTravel => &["deg_h_per_deg_signed_travel"],
            Size::Position => &["cos_deg_h", "sin_deg_h"],
            Size::Number => &["deg_h_per_move"],
        }
    }

    fn constant(&self) -> Option<(&'static str, f64)> {
        Some(("tau_s", self.tau_s.into()))
    }

    fn set_constant(&mut self, value: f64) {
        self.tau_s = value as f32;
    }

    fn words(&self) -> &'static str {
        "bias that dies away after each move of the index"
    }
}

impl fmt::Display for Settling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.by, self.first_dwell) {
            (Size::Constant, false) => "settling",
            (Size::Constant, true) => "settling-every-dwell",
            (Size::Direction, _) => "settling-by-direction",
            (Size::Travel, _) => "settling-by-travel",
            (Size::SignedTravel, _) => "settling-by-signed-travel",
            (Size::Position, _) => "settling-by-position",
            (Size::Number, _) => "settling-by-number",
        })
    }
}

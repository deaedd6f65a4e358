//! A sector of an angle.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite};

use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constant, Constants, Span, constants};
use crate::units::wrap_360_deg;

/// 1 from the one angle to the other, in the sense in which the angle grows; 0 elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sector {
    /// Degrees.
    pub from: f32,
    pub to: f32,
}

/// Where sectors begin, and how wide they are, when the search begins: a quarter and a half of a turn.
const BEGINNINGS: u8 = 8;
const WIDTHS_DEG: [f32; 2] = [90.0, 180.0];

impl Sector {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            return;
        }
        for beginning in 0..BEGINNINGS {
            let from = 360.0 / f32::from(BEGINNINGS) * f32::from(beginning);
            WIDTHS_DEG.iter().for_each(|width| each(Self { from, to: from + width }.into()));
        }
    }
}

impl ShapePart for Sector {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        let beyond = |angle: f64| wrap_360_deg(angle - f64::from(self.from));
        one(if beyond(x) < beyond(self.to.into()) { 1.0 } else { 0.0 })
    }

    fn name(&self) -> &'static str {
        "sector"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("from", self.from), Constant::place("to", self.to)])
    }

    fn set(&mut self, number: usize, value: f64) {
        if number == 0 {
            self.from = value as f32;
        } else {
            self.to = value as f32;
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.sector", &[self.from.into(), self.to.into()])
    }
}

//! A saturation: an amplifier, a magnetic core, an end stop.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::bump::SHARE;
use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constant, Constants, Span, constants};

/// tanh((x − centre)/width): a line about the centre, constant far from it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    pub centre: f32,
    pub width: f32,
}

impl Saturation {
    /// What the search begins with: as wide as a bump.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            let width = (SHARE * (span.high - span.low)) as f32;
            span.places().for_each(|centre| each(Self { centre: centre as f32, width }.into()));
        }
    }
}

impl ShapePart for Saturation {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        one(libm::tanh((x - f64::from(self.centre)) / f64::from(self.width)))
    }

    fn name(&self) -> &'static str {
        "saturation"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("centre", self.centre), Constant::scale("width", self.width)])
    }

    fn set(&mut self, number: usize, value: f64) {
        if number == 0 {
            self.centre = value as f32;
        } else {
            self.width = value as f32;
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.saturation.centre", &[self.centre.into()])?;
        positive("model.effects.factors.shape.saturation.width", self.width.into())
    }
}

//! Two straight lines that meet.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::{Shape, ShapePart, Values};
use crate::bounded::bounded;
use crate::effects::part::{Constant, Constants, Span, constants};

/// (x − at)/scale below `at` and above it, each with a slope of its own: a kink, a modulus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hinge {
    pub at: f32,
    pub scale: f32,
}

impl Hinge {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            span.places().for_each(|at| each(Self { at: at as f32, scale: span.deviation as f32 }.into()));
        }
    }
}

impl ShapePart for Hinge {
    fn count(&self) -> usize {
        2
    }

    fn values(&self, x: f64) -> Values {
        let away = (x - f64::from(self.at)) / f64::from(self.scale);
        bounded([away.min(0.0), away.max(0.0)])
    }

    fn name(&self) -> &'static str {
        "hinge"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("at", self.at)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.at = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.hinge.at", &[self.at.into()])?;
        positive("model.effects.factors.shape.hinge.scale", self.scale.into())
    }
}

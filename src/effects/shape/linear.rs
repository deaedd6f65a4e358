//! In proportion to the signal.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constants, Span};

/// (x − reference)/scale: the reference is where the effect is nothing, the scale makes a usual value 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    pub reference: f32,
    pub scale: f32,
}

impl Linear {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            each(Self { reference: span.mean as f32, scale: span.deviation as f32 }.into());
        }
    }
}

impl ShapePart for Linear {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        one((x - f64::from(self.reference)) / f64::from(self.scale))
    }

    fn name(&self) -> &'static str {
        "linear"
    }

    fn constants(&self) -> Constants {
        Constants::new()
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.linear.reference", &[self.reference.into()])?;
        positive("model.effects.factors.shape.linear.scale", self.scale.into())
    }
}

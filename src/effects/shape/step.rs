//! A step.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite};

use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constant, Constants, Span, constants};

/// Places where the search begins, evenly over the range: none is further than a thirty-second of it from the jump.
const STARTS: usize = 15;

/// 0 below `at`, 1 above.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    pub at: f32,
}

impl Step {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            let place = |number: usize| span.low + (span.high - span.low) * number as f64 / (STARTS + 1) as f64;
            (1..=STARTS).map(place).for_each(|at| each(Self { at: at as f32 }.into()));
        }
    }
}

impl ShapePart for Step {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        one(if x >= f64::from(self.at) { 1.0 } else { 0.0 })
    }

    fn name(&self) -> &'static str {
        "step"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("at", self.at)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.at = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.step.at", &[self.at.into()])
    }

    fn jumps(&self) -> bool {
        true
    }
}

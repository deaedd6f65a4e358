//! Three straight lines that meet.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::{Shape, ShapePart, Values};
use crate::bounded::bounded;
use crate::effects::part::{Constant, Constants, Span, constants};

/// Straight lines below `first`, from there to `second`, and above that, each with a slope of its own: a dead zone, a saturation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Broken {
    pub first: f32,
    pub second: f32,
    pub scale: f32,
}

/// Shares of the range between which the middle line lies when the search begins.
const STARTS: [(f64, f64); 4] = [(0.2, 0.5), (0.2, 0.8), (0.35, 0.65), (0.5, 0.8)];

impl Broken {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if span.is_angle {
            return;
        }
        let at = |share: f64| (span.low + share * (span.high - span.low)) as f32;
        for (first, second) in STARTS {
            each(Self { first: at(first), second: at(second), scale: span.deviation as f32 }.into());
        }
    }
}

impl ShapePart for Broken {
    fn count(&self) -> usize {
        3
    }

    fn values(&self, x: f64) -> Values {
        let (first, second, scale) = (f64::from(self.first), f64::from(self.second), f64::from(self.scale));
        bounded([(x - first).min(0.0) / scale, (x.min(second) - first).max(0.0) / scale, (x - second).max(0.0) / scale])
    }

    fn name(&self) -> &'static str {
        "broken"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("first", self.first), Constant::place("second", self.second)])
    }

    fn set(&mut self, number: usize, value: f64) {
        if number == 0 {
            self.first = value as f32;
        } else {
            self.second = value as f32;
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.broken.first", &[self.first.into()])?;
        if !(self.second > self.first && self.second.is_finite()) {
            return Err(Invalid::new("model.effects.factors.shape.broken.second", self.second.into(), "finite, above `first`"));
        }
        positive("model.effects.factors.shape.broken.scale", self.scale.into())
    }
}

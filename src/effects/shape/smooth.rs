//! A smooth curve.

use serde::{Deserialize, Serialize};
use quantities::limits::Invalid;

use super::{Shape, ShapePart, Values, cosines, interval};
use crate::effects::part::{Constants, Span};

/// A smooth curve between `low` and `high`, constant beyond.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smooth {
    pub low: f32,
    pub high: f32,
    /// Functions that it is made of, 1 to 6; the more, the narrower what it can follow.
    pub count: u8,
}

/// Most functions, and those of a curve that is one of several factors.
const COUNT: u8 = 6;
const FEW: u8 = 3;
/// The interval passes what was seen by this share of its range at both ends: there the curve is what the prior says of it, and sigma grows.
const MARGIN: f64 = 0.15;

impl Smooth {
    /// Whether it is for products, which have many weights.
    pub fn is_of_few(&self) -> bool {
        self.count <= FEW
    }

    /// Of most functions: those of one of fewer are the first of them.
    pub fn of_most(low: f32, high: f32) -> Self {
        Self { low, high, count: COUNT }
    }

    /// For products, which have many weights.
    pub fn of_few(low: f32, high: f32) -> Self {
        Self { low, high, count: FEW }
    }

    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            let margin = MARGIN * (span.high - span.low);
            let (low, high) = ((span.low - margin) as f32, (span.high + margin) as f32);
            each(Self::of_most(low, high).into());
            each(Self::of_few(low, high).into());
        }
    }
}

impl ShapePart for Smooth {
    fn count(&self) -> usize {
        self.count.into()
    }

    fn values(&self, x: f64) -> Values {
        cosines(x, self.low, self.high, self.count.into())
    }

    /// Variances fall with the fourth power of the frequency, as those of a curve whose slope is a random walk.
    fn prior(&self, number: usize) -> f64 {
        let j = number as f64 + 1.0;
        1.0 / (j * j)
    }

    fn name(&self) -> &'static str {
        "smooth"
    }

    fn constants(&self) -> Constants {
        Constants::new()
    }

    fn validate(&self) -> Result<(), Invalid> {
        interval("model.effects.factors.shape.smooth.high", self.low, self.high)?;
        if !(1..=COUNT).contains(&self.count) {
            return Err(Invalid::new("model.effects.factors.shape.smooth.count", self.count.into(), "1 to 6"));
        }
        Ok(())
    }
}

//! A sharp curve: kinks and steep flanks.

use serde::{Deserialize, Serialize};
use quantities::limits::Invalid;

use super::{Shape, ShapePart, Values, cosines, interval};
use crate::effects::part::{Constants, Span};

/// A sharp curve: kinks and steep flanks between `low` and `high`, constant beyond.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sharp {
    pub low: f32,
    pub high: f32,
}

/// Functions that it is made of.
const COUNT: usize = 16;
/// The interval passes what was seen by this share of its range at both ends: there the curve is what the prior says of it, and sigma grows.
const MARGIN: f64 = 0.15;

impl Sharp {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if !span.is_angle {
            let margin = MARGIN * (span.high - span.low);
            each(Self { low: (span.low - margin) as f32, high: (span.high + margin) as f32 }.into());
        }
    }
}

impl ShapePart for Sharp {
    fn count(&self) -> usize {
        COUNT
    }

    fn values(&self, x: f64) -> Values {
        cosines(x, self.low, self.high, COUNT)
    }

    /// Variances fall with the square of the frequency, as those of a random walk.
    fn prior(&self, number: usize) -> f64 {
        let j = number as f64 + 1.0;
        1.0 / j
    }

    fn name(&self) -> &'static str {
        "sharp"
    }

    fn constants(&self) -> Constants {
        Constants::new()
    }

    fn validate(&self) -> Result<(), Invalid> {
        interval("model.effects.factors.shape.sharp.high", self.low, self.high)
    }
}

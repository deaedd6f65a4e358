//! Periodic in the signal.

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, positive};

use super::{Shape, ShapePart, Values};
use crate::bounded::bounded;
use crate::effects::part::{Constant, Constants, Span, constants};

/// cos(2π x/period) and sin(2π x/period).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Harmonic {
    /// In the signal's unit; of an angle 360° by a whole number.
    pub period: f32,
}

/// Most harmonics of an angle.
const ORDERS: u8 = 4;
/// Periods of other signals that the search begins with, by the range: neighbours keep in step over a quarter of the range, so that a tuned
/// one is reached from the next start.
const MOST_PERIODS: f64 = 12.0;

impl Harmonic {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if span.is_angle {
            (1..=ORDERS).for_each(|order| each(Self { period: 360.0 / f32::from(order) }.into()));
            return;
        }
        let range = span.high - span.low;
        let counts = core::iter::successors(Some(0.5), |count| Some(count + 0.5)).take_while(|count| *count <= MOST_PERIODS);
        counts.for_each(|count| each(Self { period: (range / count) as f32 }.into()));
    }
}

impl ShapePart for Harmonic {
    fn count(&self) -> usize {
        2
    }

    fn values(&self, x: f64) -> Values {
        let (sin, cos) = libm::sincos(TAU * x / f64::from(self.period));
        bounded([cos, sin])
    }

    fn name(&self) -> &'static str {
        "harmonic"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("period", self.period)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.period = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.effects.factors.shape.harmonic.period", self.period.into())
    }
}

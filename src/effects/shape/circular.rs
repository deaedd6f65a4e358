//! A smooth curve of an angle.

use core::f64::consts::TAU;

use heapless::Vec;
use serde::{Deserialize, Serialize};
use quantities::limits::Invalid;

use super::{Shape, ShapePart, Values};
use crate::effects::part::{Constants, Span};

/// cos and sin of the angle and of its multiples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circular {
    /// Harmonics, 1 to 8.
    pub orders: u8,
}

const MOST_ORDERS: u8 = 8;
/// With how many the search begins: a sector of half a turn has a first and a third one; four heads of an encoder, a square frame or four positions of an
/// index a fourth one.
const ORDERS: u8 = 4;
/// Those of a factor of a product, which has many weights: an eccentricity and an ellipse.
const FEW: u8 = 2;

impl Circular {
    /// For products, which have many weights.
    pub fn of_few() -> Self {
        Self { orders: FEW }
    }

    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if span.is_angle {
            each(Self { orders: ORDERS }.into());
        }
    }
}

impl ShapePart for Circular {
    fn count(&self) -> usize {
        2 * usize::from(self.orders)
    }

    fn values(&self, x: f64) -> Values {
        let mut values = Vec::new();
        for order in 1..=self.orders {
            let (sin, cos) = libm::sincos(TAU * f64::from(order) * x / 360.0);
            let _ = values.push(cos);
            let _ = values.push(sin);
        }
        values
    }

    /// Variances fall with the square of the order, as those of a curve that is a random walk.
    fn prior(&self, number: usize) -> f64 {
        1.0 / (number / 2 + 1) as f64
    }

    fn name(&self) -> &'static str {
        "circular"
    }

    fn constants(&self) -> Constants {
        Constants::new()
    }

    fn validate(&self) -> Result<(), Invalid> {
        if (1..=MOST_ORDERS).contains(&self.orders) {
            Ok(())
        } else {
            Err(Invalid::new("model.effects.factors.shape.circular.orders", self.orders.into(), "1 to 8"))
        }
    }
}

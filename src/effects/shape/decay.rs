//! What dies away with time.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, positive};

use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constant, Constants, Span, constants};

/// exp(−x/tau), x a time in seconds, from 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decay {
    pub tau_s: f32,
}

impl Decay {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if span.is_time {
            span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
        }
    }
}

impl ShapePart for Decay {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        one(libm::exp(-x.max(0.0) / f64::from(self.tau_s)))
    }

    fn name(&self) -> &'static str {
        "decay"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.effects.factors.shape.decay.tau_s", self.tau_s.into())
    }
}

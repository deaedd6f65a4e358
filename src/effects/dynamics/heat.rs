//! Heat: the low-pass of a square.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, within};

use super::{Dynamics, DynamicsPart, Square, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// What a first-order low-pass makes of the square of the signal (the heat of a current); it starts at the first value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Heat {
    /// Time constant, seconds.
    pub tau_s: f32,
}

impl Heat {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
    }
}

impl DynamicsPart for Heat {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        Square { tau_s: self.tau_s, centre: 0.0 }.step(state, value, step_s)
    }

    fn name(&self) -> &'static str {
        "heat"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.effects.factors.dynamics.heat.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }
}

//! A first-order low-pass.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, within};

use super::{Dynamics, DynamicsPart, STATES, State};
use crate::effects::low_pass;
use crate::effects::part::{Constant, Constants, Span, constants};

/// What a first-order low-pass makes of the signal; it starts at the first value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LowPass {
    /// Time constant, seconds.
    pub tau_s: f32,
}

impl LowPass {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
    }
}

impl DynamicsPart for LowPass {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        let [last, ..] = state.unwrap_or([value; STATES]);
        let now = low_pass(last, value, step_s, self.tau_s.into());
        *state = Some([now; STATES]);
        now
    }

    fn name(&self) -> &'static str {
        "low-pass"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.effects.factors.dynamics.low-pass.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }

    fn is_linear(&self) -> bool {
        true
    }
}

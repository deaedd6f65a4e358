//! A delay.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, within};

use super::{Dynamics, DynamicsPart, State, share};
use crate::effects::part::{Constant, Constants, Span, constants};

/// The signal as it was: four equal low-passes in a row, whose response comes after `tau_s` on average with a spread of half of that; they
/// start at the first value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// Time constant, seconds.
    pub tau_s: f32,
}

impl Delay {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
    }
}

impl DynamicsPart for Delay {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        let mut stages = state.unwrap_or([value; 4]);
        let mut input = value;
        let share = share(step_s, 0.25 * f64::from(self.tau_s));
        for stage in &mut stages {
            *stage += (input - *stage) * share;
            input = *stage;
        }
        *state = Some(stages);
        input
    }

    fn name(&self) -> &'static str {
        "delay"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.effects.factors.dynamics.delay.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }
}

//! The rate of change.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, within};

use super::{Dynamics, DynamicsPart, STATES, State, share};
use crate::effects::part::{Constant, Constants, Span, constants};

/// What a first-order low-pass makes of the signal's rate of change, per second (Shupe, Applied Optics 19, 1980, p. 654: the rate of
/// temperature). It starts with the mean rate since the first value, until the low-pass looks back less far than that; after one value it is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Time constant, seconds.
    pub tau_s: f32,
}

/// Places in the state: the last value, what came out, and the time since the first value, seconds.
const VALUE: usize = 0;
const RATE: usize = 1;
const ELAPSED: usize = 2;

impl Rate {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
    }
}

impl DynamicsPart for Rate {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        let mut next = state.unwrap_or([0.0; STATES]);
        if let Some(last) = *state
            && step_s > 0.0
        {
            let rate = (value - last[VALUE]) / step_s;
            next[ELAPSED] += step_s;
            let share = share(step_s, self.tau_s.into()).max(step_s / next[ELAPSED]);
            next[RATE] += (rate - last[RATE]) * share;
        }
        next[VALUE] = value;
        *state = Some(next);
        next[RATE]
    }

    fn is_known(&self, state: &State) -> bool {
        state.is_some_and(|state| state[ELAPSED] != 0.0)
    }

    fn name(&self) -> &'static str {
        "rate"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.effects.factors.dynamics.rate.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn is_rate(&self) -> bool {
        true
    }
}

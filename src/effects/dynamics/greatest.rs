//! The greatest value so far: what has happened once is not undone.

use serde::{Deserialize, Serialize};
use quantities::limits::Invalid;

use super::{Dynamics, DynamicsPart, STATES, State};
use crate::effects::part::{Constants, Span};

/// The greatest value since the recording began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Greatest {}

impl Greatest {
    /// What the search begins with.
    pub fn starts(_: &Span, each: &mut dyn FnMut(Dynamics)) {
        each(Self {}.into());
    }
}

impl DynamicsPart for Greatest {
    fn step(&self, state: &mut State, value: f64, _: f64) -> f64 {
        let [last, ..] = state.unwrap_or([value; STATES]);
        let now = last.max(value);
        *state = Some([now; STATES]);
        now
    }

    fn name(&self) -> &'static str {
        "greatest"
    }

    fn constants(&self) -> Constants {
        Constants::new()
    }

    fn set(&mut self, _: usize, _: f64) {}

    fn is_rate_independent(&self) -> bool {
        true
    }

    fn validate(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

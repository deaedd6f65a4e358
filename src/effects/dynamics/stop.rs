//! What a play has not passed on: a spring that slips.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, positive};

use super::{Dynamics, DynamicsPart, Play, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// The signal less what a play of that half width makes of it: the force of a spring that slips at it, dry friction (the stop of Prandtl: Krasnosel'skii and
/// Pokrovskii, Systems with hysteresis, 1989). It starts at 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// In the signal's unit.
    pub half_width: f32,
}

impl Stop {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        Play::half_widths(span).for_each(|half_width| each(Self { half_width }.into()));
    }
}

impl DynamicsPart for Stop {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        value - Play { half_width: self.half_width }.step(state, value, step_s)
    }

    fn name(&self) -> &'static str {
        "stop"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("half_width", self.half_width)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.half_width = value as f32;
    }

    fn is_rate_independent(&self) -> bool {
        true
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.effects.factors.dynamics.stop.half_width", self.half_width.into())
    }
}

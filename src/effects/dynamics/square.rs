//! The low-pass of a squared deviation.

use quantities::limits::{Invalid, finite, within};
use serde::{Deserialize, Serialize};

use super::{Dynamics, DynamicsPart, LowPass, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// What a first-order low-pass makes of the square of what the signal deviates from a centre by (the heat of a current whose sensor has an offset, of a
/// Peltier element about its balance); it starts at the first value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Square {
    /// Time constant, seconds.
    pub tau_s: f32,
    /// In the signal's unit.
    pub centre: f32,
}

impl Square {
    /// What the search begins with: about the mean. Far from the signal's values a square is a straight line, and about 0 it is [`super::Heat`].
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s()
            .for_each(|tau_s| each(Self { tau_s: tau_s as f32, centre: span.mean as f32 }.into()));
    }
}

impl DynamicsPart for Square {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        let deviation = value - f64::from(self.centre);
        LowPass { tau_s: self.tau_s }.step(state, deviation * deviation, step_s)
    }

    fn name(&self) -> &'static str {
        "square"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s), Constant::place("centre", self.centre)])
    }

    fn set(&mut self, number: usize, value: f64) {
        match number {
            0 => self.tau_s = value as f32,
            _ => self.centre = value as f32,
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.dynamics.square.centre", &[self.centre.into()])?;
        within("model.effects.factors.dynamics.square.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }
}

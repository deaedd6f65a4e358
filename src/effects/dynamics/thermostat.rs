//! A thermostat: a relay that was switched when the recording began.

use quantities::limits::{Invalid, finite, positive};
use serde::{Deserialize, Serialize};

use super::{Dynamics, DynamicsPart, Relay, STATES, State};
use crate::effects::part::{Constants, Span};

/// A relay that starts at its upper or its lower state, as long as the signal lies between its thresholds: a heater that is off at switch-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thermostat {
    /// In the signal's unit.
    pub centre: f32,
    pub half_width: f32,
    /// Its first state is 1, not 0.
    pub from_above: bool,
}

impl Thermostat {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        for from_above in [false, true] {
            Relay::over(span)
                .for_each(|Relay { centre, half_width }| each(Self { centre, half_width, from_above }.into()));
        }
    }

    fn relay(&self) -> Relay {
        Relay { centre: self.centre, half_width: self.half_width }
    }
}

impl DynamicsPart for Thermostat {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        state.get_or_insert([if self.from_above { 1.0 } else { 0.0 }; STATES]);
        self.relay().step(state, value, step_s)
    }

    fn name(&self) -> &'static str {
        if self.from_above { "thermostat-from-above" } else { "thermostat-from-below" }
    }

    fn constants(&self) -> Constants {
        self.relay().constants()
    }

    fn set(&mut self, number: usize, value: f64) {
        let mut relay = self.relay();
        relay.set(number, value);
        (self.centre, self.half_width) = (relay.centre, relay.half_width);
    }

    fn is_rate_independent(&self) -> bool {
        true
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.dynamics.thermostat.centre", &[self.centre.into()])?;
        positive("model.effects.factors.dynamics.thermostat.half_width", self.half_width.into())
    }

    fn jumps(&self) -> bool {
        true
    }
}

//! A relay: a thermostat, a switch with hysteresis.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::{Dynamics, DynamicsPart, STATES, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// 1 above `centre + half_width`, 0 below `centre − half_width`, between them what it was; it starts by the side of the centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Relay {
    /// In the signal's unit.
    pub centre: f32,
    pub half_width: f32,
}

/// Half width that the search begins with, as a share of the signal's range; it is tuned.
const SHARE: f64 = 0.1;

impl Relay {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        let half_width = (SHARE * (span.high - span.low)) as f32;
        span.places().for_each(|centre| each(Self { centre: centre as f32, half_width }.into()));
    }
}

impl DynamicsPart for Relay {
    fn step(&self, state: &mut State, value: f64, _: f64) -> f64 {
        let above = value - f64::from(self.centre);
        let half = f64::from(self.half_width);
        let [last, ..] = state.unwrap_or([if above > 0.0 { 1.0 } else { 0.0 }; STATES]);
        let now = if above > half {
            1.0
        } else if above < -half {
            0.0
        } else {
            last
        };
        *state = Some([now; STATES]);
        now
    }

    fn name(&self) -> &'static str {
        "relay"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("centre", self.centre), Constant::scale("half_width", self.half_width)])
    }

    fn set(&mut self, number: usize, value: f64) {
        if number == 0 {
            self.centre = value as f32;
        } else {
            self.half_width = value as f32;
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.dynamics.relay.centre", &[self.centre.into()])?;
        positive("model.effects.factors.dynamics.relay.half_width", self.half_width.into())
    }
}

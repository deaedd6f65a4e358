//! Hysteresis by a play.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, positive};

use super::{Dynamics, DynamicsPart, STATES, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// A play of that half width follows the signal (Krasnosel'skii and Pokrovskii, Systems with hysteresis, 1989); it starts at the first value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Play {
    /// In the signal's unit.
    pub half_width: f32,
}

/// Half widths that the search begins with, as shares of the signal's range: by steps of 2, as the time constants.
const SHARES: [f64; 4] = [0.03, 0.06, 0.12, 0.25];

impl Play {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        Self::half_widths(span).for_each(|half_width| each(Self { half_width }.into()));
    }

    pub(super) fn half_widths(span: &Span) -> impl Iterator<Item = f32> {
        let range = span.high - span.low;
        SHARES.into_iter().map(move |share| (share * range) as f32)
    }
}

impl DynamicsPart for Play {
    fn step(&self, state: &mut State, value: f64, _: f64) -> f64 {
        let half = f64::from(self.half_width);
        let [last, ..] = state.unwrap_or([value; STATES]);
        let now = last.max(value - half).min(value + half);
        *state = Some([now; STATES]);
        now
    }

    fn name(&self) -> &'static str {
        "play"
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
        positive("model.effects.factors.dynamics.play.half_width", self.half_width.into())
    }
}

//! A relay: a switch with hysteresis.

use quantities::limits::{Invalid, finite, positive};
use serde::{Deserialize, Serialize};

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

impl Relay {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        Self::over(span).for_each(|relay| each(relay.into()));
    }

    /// Narrow and wide relays, in standard deviations of the signal: 0.3 and 1.2 from one threshold to the other, about the tenths 1, 3, 5, 7 and 9 of a normal
    /// distribution. A hysteresis is mostly narrow by the course of its signal, and places are tuned.
    pub(super) fn over(span: &Span) -> impl Iterator<Item = Self> + use<'_> {
        let half_widths = [0.15, 0.6].into_iter();
        let about = |half: f64| [-1.28, -0.52, 0.0, 0.52, 1.28].map(|centre: f64| (centre - half, centre + half));
        let at = move |deviations: f64| span.mean + deviations * span.deviation;
        half_widths.flat_map(about).map(move |(low, high)| Self::between(at(low), at(high)))
    }

    fn between(low: f64, high: f64) -> Self {
        Self { centre: (0.5 * (low + high)) as f32, half_width: (0.5 * (high - low)) as f32 }
    }

    /// The values at which it switches, each for itself: this is what the search tunes.
    fn thresholds(&self) -> [f32; 2] {
        [self.centre - self.half_width, self.centre + self.half_width]
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
        let [low, high] = self.thresholds();
        constants([Constant::place("low", low), Constant::place("high", high)])
    }

    fn set(&mut self, number: usize, value: f64) {
        let mut thresholds = self.thresholds();
        if let Some(threshold) = thresholds.get_mut(number) {
            *threshold = value as f32;
        }
        let [low, high] = thresholds;
        *self = Self::between(low.into(), high.into());
    }

    fn is_rate_independent(&self) -> bool {
        true
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.dynamics.relay.centre", &[self.centre.into()])?;
        positive("model.effects.factors.dynamics.relay.half_width", self.half_width.into())
    }

    fn jumps(&self) -> bool {
        true
    }
}

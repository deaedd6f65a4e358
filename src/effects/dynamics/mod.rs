//! Dynamics: what stands between a signal and its effect. Causal, a few numbers of state each. One file a dynamics, and one line here, after
//! the others: stored settings number them.

use core::fmt;

use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::part::{Constants, Span, parts};

/// Numbers of state of one dynamics: a delay keeps eight means and what the next one is made of.
pub const STATES: usize = 10;

/// What a dynamics remembers; `None`: nothing was seen yet.
pub type State = Option<[f64; STATES]>;

/// What every dynamics says of itself.
pub trait DynamicsPart {
    /// Takes the signal's next value, `step_s` after the one before, and gives what comes out.
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64;
    /// Its name, lower case, with hyphens.
    fn name(&self) -> &'static str;
    /// The numbers that the search tunes.
    fn constants(&self) -> Constants;
    /// Sets the constant of that number.
    fn set(&mut self, number: usize, value: f64);
    /// Constants in their range.
    fn validate(&self) -> Result<(), Invalid>;
    /// What came out last is known: one value of a signal says nothing of its rate of change.
    fn is_known(&self, _: &State) -> bool {
        true
    }
    /// What comes out of a sum is the sum of what comes out of its parts.
    fn is_linear(&self) -> bool {
        false
    }
    /// What comes out depends on the values that went in and on their order, not on the time between them.
    fn is_rate_independent(&self) -> bool {
        false
    }
    /// What comes out jumps where the signal passes one of its constants.
    fn jumps(&self) -> bool {
        false
    }
    /// Divides by a time, so that a second's noise grows: what comes out has the unit of the signal per second.
    fn is_rate(&self) -> bool {
        false
    }
}

parts! {
    /// A dynamics.
    Dynamics is DynamicsPart of
    low_pass::LowPass,
    memory::Memory,
    rate::Rate,
    delay::Delay,
    play::Play,
    relay::Relay,
    greatest::Greatest,
    heat::Heat,
    stop::Stop,
    thermostat::Thermostat,
    square::Square,
}

impl Dynamics {
    /// Takes the signal's next value, `step_s` after the one before, and gives what comes out.
    pub fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        self.part().step(state, value, step_s)
    }

    pub fn is_known(&self, state: &State) -> bool {
        self.part().is_known(state)
    }

    pub fn constants(&self) -> Constants {
        self.part().constants()
    }

    pub fn set(&mut self, number: usize, value: f64) {
        self.part_mut().set(number, value);
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        self.part().validate()
    }

    pub fn is_linear(&self) -> bool {
        self.part().is_linear()
    }

    pub fn is_rate_independent(&self) -> bool {
        self.part().is_rate_independent()
    }

    pub fn jumps(&self) -> bool {
        self.part().jumps()
    }

    pub fn is_rate(&self) -> bool {
        self.part().is_rate()
    }
}

impl fmt::Display for Dynamics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.part().name())
    }
}

/// The share of the way to what comes in that a first-order low-pass goes in `step_s`.
pub(super) fn share(step_s: f64, tau_s: f64) -> f64 {
    1.0 - libm::exp(-step_s / tau_s)
}

//! A factor: a shape of a signal behind a dynamics.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::dynamics::{Dynamics, State};
use super::now::Now;
use super::part::Constant;
use super::shape::{Shape, Values};
use super::signal::Signal;
use crate::limits::Invalid;

/// Most dynamics in a row: the memory of a rate takes two.
pub const MAX_CHAIN: usize = 2;
/// Most constants of one factor.
pub const MAX_FACTOR_CONSTANTS: usize = 6;

/// Shape(dynamics(signal)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    pub signal: Signal,
    /// What the signal passes on its way, in this order; empty: nothing.
    #[serde(default)]
    pub dynamics: Vec<Dynamics, MAX_CHAIN>,
    pub shape: Shape,
}

/// What the dynamics of a factor remember.
pub type Memory = [State; MAX_CHAIN];

impl Factor {
    pub fn new(signal: Signal, dynamics: &[Dynamics], shape: Shape) -> Self {
        Self { signal, dynamics: dynamics.iter().copied().take(MAX_CHAIN).collect(), shape }
    }

    /// What comes out of the dynamics in this second; `None`: the signal says nothing. Must be called every second, in the order of time.
    pub fn input(&self, now: &Now<'_>, memory: &mut Memory) -> Option<f64> {
        self.pass(self.signal.value(now), now.track.step_s, memory)
    }

    /// The same of a signal's value, `step_s` after the one before.
    pub fn pass(&self, value: Option<f64>, step_s: f64, memory: &mut Memory) -> Option<f64> {
        let Some(mut value) = value else {
            *memory = Memory::default();
            return None;
        };
        for (dynamics, state) in self.dynamics.iter().zip(memory) {
            value = dynamics.step(state, value, step_s);
        }
        Some(value)
    }

    /// The values of its functions in this second. Must be called every second, in the order of time.
    pub fn values(&self, now: &Now<'_>, memory: &mut Memory) -> Option<Values> {
        self.input(now, memory).map(|input| self.shape.values(input))
    }

    /// How many functions it has.
    pub fn count(&self) -> usize {
        self.shape.count()
    }

    /// It depends on the azimuth that is sought.
    pub fn needs_azimuth(&self) -> bool {
        self.signal.needs_azimuth()
    }

    /// The constants that the search tunes: those of the dynamics, then those of the shape. The harmonics of an angle are whole numbers and
    /// not tuned.
    pub fn constants(&self) -> Vec<Constant, MAX_FACTOR_CONSTANTS> {
        let of_shape = self.shape.constants().into_iter().filter(|_| !self.is_harmonic_of_angle());
        self.dynamics.iter().flat_map(Dynamics::constants).chain(of_shape).take(MAX_FACTOR_CONSTANTS).collect()
    }

    /// Sets the constant of that number in [`Self::constants`].
    pub fn set(&mut self, number: usize, value: f64) {
        let mut first = 0;
        for dynamics in &mut self.dynamics {
            let count = dynamics.constants().len();
            if number < first + count {
                return dynamics.set(number - first, value);
            }
            first += count;
        }
        self.shape.set(number - first, value);
    }

    fn is_harmonic_of_angle(&self) -> bool {
        self.signal.is_angle() && matches!(self.shape, Shape::Harmonic(_))
    }

    pub fn channels(&self) -> impl Iterator<Item = &ChannelName> {
        self.signal.channels()
    }

    /// Constants in their range; nothing behind a dynamics that depends on the azimuth, which is known only when all is over.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.signal.validate()?;
        self.dynamics.iter().try_for_each(Dynamics::validate)?;
        self.shape.validate()?;
        if self.needs_azimuth() && !self.dynamics.is_empty() {
            let (field, number) = ("model.effects.factors.dynamics (number)", self.dynamics.len() as f64);
            return Err(Invalid::new(field, number, "none behind the signals axis and rate"));
        }
        Ok(())
    }
}

/// The signal, what it passes, and the shape where it is not linear.
impl fmt::Display for Factor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.signal.fmt(f)?;
        self.dynamics.iter().try_for_each(|dynamics| write!(f, "-{dynamics}"))?;
        if matches!(self.shape, Shape::Linear(_)) { Ok(()) } else { write!(f, "-{}", self.shape) }
    }
}

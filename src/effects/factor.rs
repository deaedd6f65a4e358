//! A factor: a shape of a signal behind a dynamics.

use core::fmt;

use heapless::Vec;
use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::dynamics::{Dynamics, State};
use super::part::Constant;
use super::shape::{MAX_FUNCTIONS, Shape};
use super::signal::Signal;
use crate::bounded::bounded;

/// Most dynamics in a row: the memory of a rate takes two.
pub const MAX_CHAIN: usize = 2;
/// Most constants of one factor.
pub const MAX_FACTOR_CONSTANTS: usize = 7;

/// Shape(dynamics(signal)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    pub signal: Signal,
    /// What the signal passes on its way, in this order; empty: nothing.
    #[serde(default)]
    pub dynamics: Vec<Dynamics, MAX_CHAIN>,
    pub shape: Shape,
    /// A constant, 1, is a function of it too, before those of the shape: the other factors of a product then act without this one as well.
    #[serde(default)]
    pub constant: bool,
}

/// What the dynamics of a factor remember.
pub type Memory = [State; MAX_CHAIN];
/// Values of a factor's functions.
pub type Functions = Vec<f64, { MAX_FUNCTIONS + 1 }>;

impl Factor {
    pub fn new(signal: Signal, dynamics: &[Dynamics], shape: Shape) -> Self {
        Self { signal, dynamics: bounded(dynamics.iter().copied()), shape, constant: false }
    }

    /// The same with a constant among its functions.
    pub fn with_constant(self) -> Self {
        Self { constant: true, ..self }
    }

    /// What comes out of the dynamics of a signal's value, `step_s` after the one before; `None`: the signal says nothing, and the dynamics forget
    /// all; or it is not known yet. Must be called every second, in the order of time.
    pub fn pass(&self, value: Option<f64>, step_s: f64, memory: &mut Memory) -> Option<f64> {
        let Some(mut value) = value else {
            *memory = Memory::default();
            return None;
        };
        for (dynamics, state) in self.dynamics.iter().zip(memory) {
            value = dynamics.step(state, value, step_s);
            if !dynamics.is_known(state) {
                return None;
            }
        }
        Some(value)
    }

    /// How many functions it has.
    pub fn count(&self) -> usize {
        usize::from(self.constant) + self.shape.count()
    }

    /// Their values, where this comes out of its dynamics.
    pub fn values(&self, x: f64) -> Functions {
        let mut values = Functions::new();
        if self.constant {
            let _ = values.push(1.0);
        }
        let _ = values.extend_from_slice(&self.shape.values(x));
        values
    }

    /// Standard deviation of the weight of the function of that number, from 0, before anything is learned: relative to the effect's size.
    pub fn prior(&self, number: usize) -> f64 {
        number.checked_sub(usize::from(self.constant)).map_or(1.0, |of_shape| self.shape.prior(of_shape))
    }

    /// It depends on the azimuth that is sought.
    pub fn needs_azimuth(&self) -> bool {
        self.signal.needs_azimuth()
    }

    /// It depends on the azimuth behind dynamics: what it is now depends on what the axis met on its way, which the solution goes again.
    pub fn is_replayed(&self) -> bool {
        self.needs_azimuth() && !self.dynamics.is_empty()
    }

    /// What comes out of its dynamics changes with time alone.
    pub fn takes_time(&self) -> bool {
        !self.dynamics.iter().all(Dynamics::is_rate_independent)
    }

    /// The constants that the search tunes: those of the dynamics, then those of the shape, then that of the signal. The harmonics of an angle are whole
    /// numbers and not tuned.
    pub fn constants(&self) -> Vec<Constant, MAX_FACTOR_CONSTANTS> {
        let of_shape = self.shape.constants().into_iter().filter(|_| !self.is_harmonic_of_angle());
        bounded(self.dynamics.iter().flat_map(Dynamics::constants).chain(of_shape).chain(self.signal.constant()))
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
        if number - first < self.shape.constants().len() {
            self.shape.set(number - first, value);
        } else {
            self.signal.set(value);
        }
    }

    fn is_harmonic_of_angle(&self) -> bool {
        self.signal.is_angle() && matches!(self.shape, Shape::Harmonic(_))
    }

    pub fn channels(&self) -> impl Iterator<Item = &ChannelName> {
        self.signal.channels()
    }

    /// Constants in their range. The azimuth is known only when all is over: of what depends on it the rate alone is behind dynamics.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.signal.validate()?;
        self.dynamics.iter().try_for_each(Dynamics::validate)?;
        self.shape.validate()?;
        if self.signal.needs_dynamics() && self.dynamics.is_empty() {
            return Err(Invalid::new(
                "model.effects.factors.dynamics (number)",
                0.0,
                "one or two behind the signal measured",
            ));
        }
        if self.is_replayed() && self.signal != Signal::Rate {
            let (field, number) = ("model.effects.factors.dynamics (number)", self.dynamics.len() as f64);
            return Err(Invalid::new(field, number, "none behind the signal axis"));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::conditions::Conditions;
    use crate::effects::dynamics::{
        DynamicsPart, LowPass, Memory as Remembered, Play, Rate, Relay, Square, Stop, Thermostat,
    };
    use crate::effects::now::{Now, RunFacts};
    use crate::effects::shape::Linear;
    use crate::effects::signal::{Since, Time, WeightedDifference};
    use crate::effects::track::Track;

    const IDENTITY: Linear = Linear { reference: 0.0, scale: 1.0 };

    fn outputs(dynamics: &[Dynamics], values: &[f64], step_s: f64) -> std::vec::Vec<f64> {
        let factor = Factor::new(Time.into(), dynamics, IDENTITY.into());
        let mut memory = Memory::default();
        values.iter().map(|&value| factor.pass(Some(value), step_s, &mut memory).unwrap_or(f64::NAN)).collect()
    }

    /// By hand, steps of 2 s. Rate: not known at first, then 3 per 2 s, which a low-pass of 2/ln 2 s halves towards 0; one of 200 s looks back to the first
    /// value: the means are 3 per 2 s, per 4 s and per 6 s. A play of 1 follows from 0 to 2 and
    /// stays until the value is 1 below it.
    #[test]
    fn dynamics_by_hand() {
        let tau_s = (2.0 / core::f64::consts::LN_2) as f32;
        let rates = outputs(&[Rate { tau_s }.into()], &[1.0, 4.0, 4.0, 4.0], 2.0);
        assert!(rates[0].is_nan(), "one value has no rate of change");
        for (found, expected) in rates[1..].iter().zip([1.5, 0.75, 0.375]) {
            assert!((found - expected).abs() < 1e-6, "{rates:?}");
        }
        let means = outputs(&[Rate { tau_s: 200.0 }.into()], &[1.0, 4.0, 4.0, 4.0], 2.0);
        for (found, expected) in means[1..].iter().zip([1.5, 0.75, 0.5]) {
            assert!((found - expected).abs() < 1e-6, "{means:?}");
        }
        // A low-pass behind it starts at the first rate of change: 1.5, then half of the way to 0.75.
        let smooth = outputs(&[Rate { tau_s }.into(), LowPass { tau_s }.into()], &[1.0, 4.0, 4.0], 2.0);
        assert!(smooth[0].is_nan() && (smooth[1] - 1.5).abs() < 1e-6 && (smooth[2] - 1.125).abs() < 1e-6, "{smooth:?}");
        assert_eq!(outputs(&[Play { half_width: 1.0 }.into()], &[0.0, 3.0, 1.5, 0.5], 1.0), [0.0, 2.0, 2.0, 1.5]);
        assert_eq!(outputs(&[Stop { half_width: 1.0 }.into()], &[0.0, 3.0, 1.5, 0.5], 1.0), [0.0, 1.0, -0.5, -1.0]);
        // Between its thresholds, 0 and 2, a relay starts by its centre, and a thermostat as it was switched.
        let (centre, half_width) = (1.0, 1.0);
        let course = [1.5, 0.5, 2.5, 0.5, -0.5, 1.5];
        assert_eq!(outputs(&[Relay { centre, half_width }.into()], &course, 1.0), [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
        let [below, above] = [false, true].map(|from_above| Thermostat { centre, half_width, from_above }.into());
        assert_eq!(outputs(&[below], &course, 1.0), [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        assert_eq!(outputs(&[above], &course[1..], 1.0), [1.0, 1.0, 1.0, 0.0, 0.0]);
        // Of a relay that switches at 0 and 2 the upper threshold goes to 4, and the lower one stays.
        let mut relay = Relay { centre, half_width };
        relay.set(1, 4.0);
        assert_eq!(relay, Relay { centre: 2.0, half_width: 2.0 });
        assert!(relay.constants().iter().map(|constant| constant.value).eq([0.0, 4.0]));
        // Squares of the distance from 1: 1, 9, 9; a low-pass of 2/ln 2 s halves what is left of the way.
        let squares = outputs(&[Square { tau_s, centre: 1.0 }.into()], &[0.0, 4.0, -2.0], 2.0);
        assert!((squares[1] - 5.0).abs() < 1e-6 && (squares[2] - 7.0).abs() < 1e-6, "{squares:?}");
        // What has not passed a low-pass of 2/ln 2 s: a half after 2 s, a quarter after 4 s.
        let memory = outputs(&[Remembered { tau_s }.into()], &[0.0, 8.0, 8.0], 2.0);
        assert!((memory[1] - 4.0).abs() < 1e-6 && (memory[2] - 2.0).abs() < 1e-6, "{memory:?}");
    }

    /// 30 − 0.5 · (14 − 10) = 28, as a sum 32; without the second channel there is none. The ratio is the last constant, behind those of the shape.
    #[test]
    fn a_weighted_difference_by_hand() {
        let name = |text| ChannelName::new(text).unwrap();
        let of = |ratio| WeightedDifference { plus: name("a_c"), minus: name("b_v"), ratio, reference: 10.0 };
        let value = |ratio, minus| {
            let mut conditions = Conditions::default();
            conditions.channels[..2].copy_from_slice(&[30.0, minus]);
            let (track, run) = (Track::default(), RunFacts::default());
            let channels = &[name("a_c"), name("b_v")];
            Signal::from(of(ratio)).value(&Now {
                conditions: &conditions,
                channels,
                track: &track,
                run: &run,
                belief: None,
            })
        };
        assert_eq!((value(0.5, 14.0), value(-0.5, 14.0), value(0.5, f64::NAN)), (Some(28.0), Some(32.0), None));
        assert_eq!(std::format!("{}", Signal::from(of(-0.5))), "a_c-and-b_v");
        let mut factor = Factor::new(of(0.5).into(), &[], crate::effects::shape::Decay { tau_s: 7.0 }.into());
        factor.set(1, 0.75);
        assert!(factor.constants().iter().map(|constant| constant.value).eq([7.0, 0.75]));
        assert_eq!(factor.signal, of(0.75).into());
    }

    #[test]
    fn a_missing_value_begins_anew() {
        let factor = Factor::new(Time.into(), &[Rate { tau_s: 1.0 }.into()], IDENTITY.into());
        let mut memory = Memory::default();
        assert_eq!(factor.pass(Some(1.0), 1.0, &mut memory), None);
        assert_eq!(factor.pass(Some(2.0), 1.0, &mut memory), Some(1.0));
        assert_eq!(factor.pass(None, 1.0, &mut memory), None);
        assert_eq!(factor.pass(Some(5.0), 1.0, &mut memory), None);
    }

    #[test]
    fn a_constant_comes_before_the_functions_of_the_shape() {
        let hinge = crate::effects::shape::Hinge { at: 1.0, scale: 2.0 };
        let factor = Factor::new(Time.into(), &[], hinge.into()).with_constant();
        assert_eq!(factor.count(), 3);
        assert_eq!(factor.values(5.0).as_slice(), [1.0, 0.0, 2.0]);
        assert_eq!((factor.prior(0), factor.prior(2)), (1.0, 1.0));
    }

    #[test]
    fn a_measured_rate_by_itself_is_refused() {
        let measured =
            |dynamics: &[Dynamics]| Factor::new(crate::effects::signal::Measured.into(), dynamics, IDENTITY.into());
        assert!(measured(&[]).validate().is_err());
        assert!(measured(&[Rate { tau_s: 3.0 }.into()]).validate().is_ok());
    }

    #[test]
    fn constants_of_dynamics_come_before_those_of_the_shape() {
        let decay = crate::effects::shape::Decay { tau_s: 7.0 };
        let mut factor = Factor::new(Since.into(), &[Rate { tau_s: 3.0 }.into()], decay.into());
        assert!(factor.constants().iter().map(|constant| constant.value).eq([3.0, 7.0]));
        factor.set(1, 9.0);
        factor.set(0, 4.0);
        assert!(factor.constants().iter().map(|constant| constant.value).eq([4.0, 9.0]));
    }
}

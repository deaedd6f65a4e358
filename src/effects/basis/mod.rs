//! The functions that a term is a sum of, before its coefficients: one file a cause.
//!
//! A basis is one function or several (powers, cosine and sine, a curve's parts) of what a second was like.

pub mod curve;
pub mod drift;
pub mod harmonic;
pub mod line;
pub mod settling;
pub mod step;
pub mod warm_up;

use core::fmt;

use heapless::Vec;
use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::conditions::Conditions;
use super::moves::Moves;
use super::window::Window;
use crate::bounded::bounded;
use curve::Curve;
use drift::Drift;
use harmonic::BodyHarmonic;
use line::Line;
use settling::Settling;
use step::Step;
use warm_up::WarmUp;

/// Most functions of one basis.
pub const MAX_FUNCTIONS: usize = 7;

/// Functions of one cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    Curve(Curve),
    Drift(Drift),
    WarmUp(WarmUp),
    Settling(Settling),
    BodyHarmonic(BodyHarmonic),
    Line(Line),
    Step(Step),
}

/// Values of the functions in a second.
pub type Values = Vec<f64, MAX_FUNCTIONS>;

/// Why there are no values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The channel says nothing; the effect counts as none.
    Absent,
    /// A rate of change is not known yet.
    Waiting,
}

/// What the functions are of.
#[derive(Clone, Copy)]
pub struct Now<'a> {
    pub conditions: &'a Conditions,
    /// Seconds since the middle of the second before; 0 for the first.
    pub step_s: f64,
    /// Names of the conditions' further channels.
    pub channels: &'a [ChannelName],
    pub windows: &'a [Window],
    pub moves: &'a Moves,
}

/// What every basis says of itself.
trait Functions {
    /// How many functions there are.
    fn count(&self) -> usize;
    /// Their values now. `memory` is the basis' own, `None` at first.
    fn values(&self, now: &Now<'_>, memory: &mut Option<f64>) -> Result<Values, Missing>;
    /// Parameters finite and in their range.
    fn validate(&self) -> Result<(), Invalid>;
    /// Names of the coefficients, with their units.
    fn coefficient_names(&self) -> &'static [&'static str];
    /// Name and value of the one parameter that the functions are not linear in, if there is one.
    fn constant(&self) -> Option<(&'static str, f64)> {
        None
    }
    /// The same functions with another value of that parameter.
    fn set_constant(&mut self, _value: f64) {}
    /// What it is, for a report.
    fn words(&self) -> &'static str;
}

impl Basis {
    fn functions(&self) -> &dyn Functions {
        match self {
            Self::Curve(basis) => basis,
            Self::Drift(basis) => basis,
            Self::WarmUp(basis) => basis,
            Self::Settling(basis) => basis,
            Self::BodyHarmonic(basis) => basis,
            Self::Line(basis) => basis,
            Self::Step(basis) => basis,
        }
    }

    /// How many functions there are.
    pub fn count(&self) -> usize {
        self.functions().count()
    }

    /// Their values now; `memory` is the basis' own, `None` at first.
    pub fn values(&self, now: &Now<'_>, memory: &mut Option<f64>) -> Result<Values, Missing> {
        self.functions().values(now, memory)
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        self.functions().validate()
    }

    /// Names of the coefficients, with their units.
    pub fn coefficient_names(&self) -> &'static [&'static str] {
        self.functions().coefficient_names()
    }

    /// Name and value of the one parameter that the functions are not linear in, if there is one.
    pub fn constant(&self) -> Option<(&'static str, f64)> {
        self.functions().constant()
    }

    /// The same functions with another value of that parameter.
    pub fn with_constant(mut self, value: f64) -> Self {
        let functions: &mut dyn Functions = match &mut self {
            Self::Curve(basis) => basis,
            Self::Drift(basis) => basis,
            Self::WarmUp(basis) => basis,
            Self::Settling(basis) => basis,
            Self::BodyHarmonic(basis) => basis,
            Self::Line(basis) => basis,
            Self::Step(basis) => basis,
        };
        functions.set_constant(value);
        self
    }

    /// What it is, for a report.
    pub fn words(&self) -> &'static str {
        self.functions().words()
    }

    /// The channel that it follows.
    pub fn channel(&self) -> Option<&ChannelName> {
        match self {
            Self::Curve(curve) => Some(&curve.channel),
            _ => None,
        }
    }

    /// The window of the past that it needs: channel and time constant of a low-pass.
    pub fn window(&self) -> Option<(&ChannelName, f32)> {
        match self {
            Self::Curve(curve) => curve.signal.window_low_pass_s().map(|low_pass_s| (&curve.channel, low_pass_s)),
            _ => None,
        }
    }

    /// Whether it is a rate of change, which a few seconds must pass for.
    pub fn is_rate(&self) -> bool {
        matches!(self, Self::Curve(curve) if curve.signal.is_rate())
    }

    /// Numbers of its knots.
    pub fn knots(&self) -> usize {
        match self {
            Self::Curve(curve) => curve.function.knots().len(),
            _ => 0,
        }
    }
}

/// The stable name: lower-case words with hyphens.
impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Curve(curve) => curve.fmt(f),
            Self::Drift(drift) => drift.fmt(f),
            Self::WarmUp(_) => f.write_str("warm-up"),
            Self::Settling(settling) => settling.fmt(f),
            Self::BodyHarmonic(BodyHarmonic { order }) => write!(f, "body-harmonic-{order}"),
            Self::Line(_) => f.write_str("sinusoid"),
            Self::Step(_) => f.write_str("step"),
        }
    }
}

/// Values from numbers; the rest is dropped if there are more than a basis has.
fn values_of(numbers: impl IntoIterator<Item = f64>) -> Values {
    bounded(numbers)
}

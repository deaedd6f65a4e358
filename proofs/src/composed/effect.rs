//! A hidden effect: a product of factors at a port.

use super::dynamics::Dynamics;
use super::plan::Plan;
use super::process::Process;
use super::shape::Shape;
use super::signal::{Signal, View};

/// Where an effect enters the instrument; the unit of its weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// Adds to the rate, °/h.
    Adds,
    /// Scales the rate, a ratio.
    Scales,
    /// The encoder reads too large, degrees.
    Turns,
    /// The forward or else the left level accelerometer reads too large, degrees (g in small angles).
    Tilts { forward: bool },
}

impl Port {
    pub fn name(self) -> &'static str {
        match self {
            Self::Adds => "adds",
            Self::Scales => "scales",
            Self::Turns => "turns",
            Self::Tilts { .. } => "tilts",
        }
    }

    /// More than this, rms, no instrument has that anyone would look at.
    pub(super) fn most(self) -> f64 {
        match self {
            Self::Adds => 5.0,
            Self::Scales => 0.05,
            Self::Turns => 3.0,
            Self::Tilts { .. } => 2.0,
        }
    }
}

/// A signal behind a dynamics, standardised before and after over the resting seconds of the campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    pub signal: Signal,
    pub dynamics: Dynamics,
    /// Mean and standard deviation before and after the dynamics; (0, 1) where the shape takes degrees or seconds.
    pub(super) before: [f64; 2],
    pub(super) after: [f64; 2],
    /// Where the state begins in each run, for [`Dynamics::Across`].
    pub(super) states: Vec<f64>,
}

impl Input {
    pub(super) fn course(&self, view: &View<'_>, run: usize, spreads: &[[f64; 2]]) -> Vec<f64> {
        let mut course = self.signal.course(view, spreads);
        course.iter_mut().for_each(|value| *value = (*value - self.before[0]) / self.before[1]);
        let mut course = self.dynamics.apply(&course, self.states.get(run).copied().unwrap_or_default());
        course.iter_mut().for_each(|value| *value = (*value - self.after[0]) / self.after[1]);
        course
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    pub input: Input,
    /// Of a surface.
    pub other: Option<Input>,
    pub shape: Shape,
}

impl Factor {
    fn course(&self, view: &View<'_>, run: usize, spreads: &[[f64; 2]]) -> Vec<f64> {
        let first = self.input.course(view, run, spreads);
        let other = self.other.as_ref().map(|other| other.course(view, run, spreads));
        let begins = self.input.signal.begins_with_move();
        let begin = if begins { view.moves.first().map_or(first.len(), |one| one.end_s) } else { 0 };
        let value = |(second, &x): (usize, &f64)| match second {
            _ if second < begin => 0.0,
            _ => self.shape.value(x, other.as_ref().map_or(0.0, |other| other[second])),
        };
        first.iter().enumerate().map(value).collect()
    }

    fn describe(&self, plan: &Plan) -> String {
        let input = |input: &Input| {
            let signal = match input.signal {
                Signal::Channel(channel) => plan.channels[channel].name.clone(),
                Signal::Difference(first, other) => {
                    format!("{} less {}", plan.channels[first].name, plan.channels[other].name)
                }
                signal => signal.name().to_owned(),
            };
            match &input.dynamics {
                Dynamics::None => signal,
                dynamics => format!("{dynamics:?} of {signal}"),
            }
        };
        let other = self.other.as_ref().map(|other| format!(" and {}", input(other))).unwrap_or_default();
        format!("{:?} of {}{other}", self.shape, input(&self.input))
    }
}

/// How the weight changes over the campaign, from 0 at the first run to 1 at the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drift {
    None,
    Even { gain: f64 },
    Step { at: f64, gain: f64 },
}

impl Drift {
    fn factor(self, place: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Even { gain } => 1.0 + gain * (place - 0.5),
            Self::Step { at, gain } => {
                if place > at {
                    1.0 + gain
                } else {
                    1.0
                }
            }
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    pub port: Port,
    pub factors: Vec<Factor>,
    pub process: Option<Process>,
    pub drift: Drift,
    /// In the unit of the port: about the rms of the effect.
    pub weight: f64,
    /// Makes the product's rms over the resting seconds 1.
    pub(super) unit: f64,
}

/// Factors that a product inside the grammar may have.
pub const MOST_INSIDE: usize = 3;

impl Effect {
    /// The product of the factors with a weight of 1, without the process, one value a second.
    pub(super) fn course(&self, plan: &Plan, run: usize, view: &View<'_>, spreads: &[[f64; 2]]) -> Vec<f64> {
        let place = run as f64 / (plan.runs.len().max(2) - 1) as f64;
        let mut product = vec![self.unit * self.drift.factor(place); view.index_deg.len()];
        for factor in &self.factors {
            let course = factor.course(view, run, spreads);
            product.iter_mut().zip(course).for_each(|(product, value)| *product *= value);
        }
        product
    }

    /// Whether anything in it is outside the grammar.
    pub fn is_outside(&self) -> bool {
        let inputs = || self.factors.iter().flat_map(|factor| std::iter::once(&factor.input).chain(&factor.other));
        self.factors.len() > MOST_INSIDE
            || self.process.is_some()
            || self.drift != Drift::None
            || inputs().any(|input| input.dynamics.is_outside())
    }

    /// Port, shapes, dynamics and signals in short.
    pub fn name(&self) -> String {
        let input = |input: &Input| match &input.dynamics {
            Dynamics::None => input.signal.name().to_owned(),
            dynamics => format!("{}({})", dynamics.name(), input.signal.name()),
        };
        let mut words: Vec<String> = self
            .factors
            .iter()
            .map(|factor| {
                let other = factor.other.as_ref().map(|other| format!(",{}", input(other))).unwrap_or_default();
                format!("{}[{}{other}]", factor.shape.name(), input(&factor.input))
            })
            .collect();
        words.extend(self.process.map(|process| process.name().to_owned()));
        match self.drift {
            Drift::None => {}
            Drift::Even { .. } => words.push("drifting-weight".to_owned()),
            Drift::Step { .. } => words.push("stepping-weight".to_owned()),
        }
        format!("{}:{}", self.port.name(), words.join("*"))
    }

    /// Everything, with its constants.
    pub(super) fn describe(&self, plan: &Plan) -> String {
        let mut parts: Vec<String> = self.factors.iter().map(|factor| factor.describe(plan)).collect();
        parts.extend(self.process.map(|process| format!("{process:?}")));
        if self.drift != Drift::None {
            parts.push(format!("{:?}", self.drift));
        }
        format!("{:?}, {:.4} × {}", self.port, self.weight, parts.join(" × "))
    }
}

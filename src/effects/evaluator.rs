//! The model at work, second by second: it remembers what low-passes, plays, lags, rates of change and moves need.

use heapless::Vec;

use super::basis::{Missing, Now};
use super::carried::Carried;
use super::channel::{ChannelName, MAX_CHANNELS};
use super::conditions::Conditions;
use super::doubt::MAX_DIRECTIONS;
use super::effect::{Effect, MAX_FACTORS, Memories, Port};
use super::factor::MAX_CHAIN;
use super::moves::Moves;
use super::now::{self, RunFacts};
use super::plausible::LastReadings;
use super::term::Memory;
use super::track::Track;
use super::window::Window;
use super::{ErrorModel, MAX_EFFECTS, MAX_TERMS, MAX_WINDOWS};
use crate::sensing::level::Specific;

/// Most steps of Newton's method, the half width of its slopes, and their least value.
const NEWTON_STEPS: usize = 12;
const SLOPE_DEG_H: f64 = 1e-4;
const LEAST_SLOPE: f64 = 0.1;

/// The model in one second: what turns a raw rate into a true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    pub bias_deg_h: f64,
    /// One plus the scale factor error.
    pub scale: f64,
    /// A rate of change is not known yet; what follows one is missing from the bias.
    pub waiting: bool,
    /// What an effect does is not known yet: the second is of no use.
    pub unknown: bool,
    /// What the encoder reads too much by the effects, degrees.
    pub index_deg: f64,
    /// What the level accelerometers read too much, g.
    pub level: Specific,
    /// What the solution needs, which knows the azimuth.
    pub carried: Carried,
}

impl Correction {
    /// True angle increment, arcsec, of a raw one over `seconds`.
    pub fn apply(&self, increment_arcsec: f64, seconds: f64) -> f64 {
        (increment_arcsec - self.bias_deg_h * seconds) / self.scale
    }
}

/// Evaluates a model second by second, in the order of time.
#[derive(Clone, Debug)]
pub struct Evaluator {
    model: ErrorModel,
    channels: Vec<ChannelName, MAX_CHANNELS>,
    windows: Vec<Window, MAX_WINDOWS>,
    memories: [Memory; MAX_TERMS],
    moves: Moves,
    of_effects: [Memories; MAX_EFFECTS],
    track: Track,
    run: RunFacts,
    last_readings: LastReadings,
    last_s: Option<f64>,
    rates_deg_h: f64,
}

impl Evaluator {
    pub fn new(mut model: ErrorModel) -> Self {
        let mut evaluator = Self::empty();
        evaluator.set_up(&mut model);
        evaluator
    }

    /// Of no model yet.
    // Inlined, so that it is made where it stays: copies of it would take kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty() -> Self {
        Self {
            model: ErrorModel::default(),
            channels: Vec::new(),
            windows: Vec::new(),
            memories: [[None; 2]; MAX_TERMS],
            moves: Moves::default(),
            of_effects: [[[None; MAX_CHAIN]; MAX_FACTORS]; MAX_EFFECTS],
            track: Track::default(),
            run: RunFacts { hour_of_day: None, rest_s: None },
            last_readings: LastReadings::default(),
            last_s: None,
            rates_deg_h: 0.0,
        }
    }

    /// Takes a model, and leaves its own in its place. Nothing was evaluated yet.
    pub fn set_up(&mut self, model: &mut ErrorModel) {
        core::mem::swap(&mut self.model, model);
        self.channels = self.model.channels();
        self.windows.clear();
        for (channel, low_pass_s) in self.model.windows() {
            if !self.windows.iter().any(|window| window.is_of(channel, low_pass_s)) {
                let _ = self.windows.push(Window::new(*channel, low_pass_s));
            }
        }
    }

    /// What is known of the run as a whole.
    pub fn set_run(&mut self, run: RunFacts) {
        self.run = run;
    }

    pub fn model(&self) -> &ErrorModel {
        &self.model
    }

    /// Takes the next second; gives what turns its raw rate into a true one.
    pub fn second(&mut self, conditions: &Conditions) -> Correction {
        self.tapped(conditions, &mut |_, _| ())
    }

    /// The same, and gives every function of the terms, by the number of its coefficient, to `tap`: what diagnosis fits
    /// coefficients to.
    pub fn tapped(&mut self, conditions: &Conditions, tap: &mut dyn FnMut(usize, f64)) -> Correction {
        let mut conditions = *conditions;
        self.last_readings.hold(&self.model.plausible, &self.channels, &mut conditions);
        let conditions = &conditions;
        let step_s = self.last_s.replace(conditions.t_s).map_or(0.0, |last_s| (conditions.t_s - last_s).max(0.0));
        self.moves.push(conditions);
        for window in &mut self.windows {
            let value = conditions.value(window.channel(), &self.channels);
            window.push(step_s, value);
        }
        let now = Now { conditions, step_s, channels: &self.channels, windows: &self.windows, moves: &self.moves };
        let (mut bias_deg_h, mut rates_deg_h, mut scale) = (self.model.bias_deg_h, 0.0, 1.0 + self.model.scale_error);
        let (mut waiting, mut first) = (false, 0);
        let mut sums = Sums::default();
        for (term, memory) in self.model.terms.iter().zip(&mut self.memories) {
            let mut sum = 0.0;
            let doubts = if term.scales { &mut sums.scale } else { &mut sums.rate };
            let evaluated = term.functions(&now, memory, &mut |place, value| {
                tap(first + place, value);
                sum += value * f64::from(term.coefficients.get(place).copied().unwrap_or(0.0));
                for (doubt, direction) in doubts.doubts.iter_mut().zip(&self.model.doubt.directions) {
                    *doubt += value * f64::from(direction.get(first + place).copied().unwrap_or(0.0));
                }
            });
            waiting |= evaluated == Err(Missing::Waiting);
            first += term.coefficients.len();
            match (term.scales, term.is_rate()) {
                (true, _) => scale += sum,
                (false, true) => rates_deg_h += sum,
                (false, false) => bias_deg_h += sum,
            }
        }
        self.rates_deg_h = rates_deg_h;
        if !waiting {
            bias_deg_h += rates_deg_h;
        }
        let (mut carried, mut unknown) = (Carried::default(), false);
        if !self.model.effects.is_empty() {
            self.track.push(conditions);
            carried.set_way(&self.track);
            unknown = self.effects(conditions, first, &mut sums, &mut carried);
            bias_deg_h += sums.rate.value;
            scale += sums.scale.value;
        }
        bias_deg_h += self.model.of_rate_deg_h(conditions.raw_rate_deg_h - bias_deg_h);
        let true_deg_h = (conditions.raw_rate_deg_h - bias_deg_h) / scale;
        for (direction, (added, scaled)) in sums.rate.doubts.iter().zip(sums.scale.doubts).enumerate() {
            carried.set_doubt(Port::Rate, direction, (added + scaled * true_deg_h) / scale);
        }
        for (port, sum) in [(Port::Index, &sums.index), (Port::Forward, &sums.forward), (Port::Left, &sums.left)] {
            sum.doubts.iter().enumerate().for_each(|(direction, doubt)| carried.set_doubt(port, direction, *doubt));
        }
        carried.set_of_bias((1.0 + self.model.scale_error) / scale - 1.0);
        let level = Specific { forward: sums.forward.value, left: sums.left.value };
        Correction { bias_deg_h, scale, waiting, unknown, index_deg: sums.index.value, level, carried }
    }

    /// Adds what the effects do in this second; `first` is the number of their first weight in the model's directions. Whether what one of them does is not
    /// known yet.
    fn effects(&mut self, conditions: &Conditions, mut first: usize, sums: &mut Sums, carried: &mut Carried) -> bool {
        let (channels, track, run) = (self.channels.as_slice(), &self.track, &self.run);
        let now = now::Now { conditions, channels, track, run, belief: None };
        let (mut gate, mut unknown) = (0, false);
        for (effect, memories) in self.model.effects.iter().zip(&mut self.of_effects) {
            let products = effect.products(&now, memories);
            unknown |= products.is_empty() && effect.is_read(&now);
            if effect.needs_azimuth() {
                for (number, product) in products.iter().enumerate() {
                    carried.set_gate(gate + number, *product);
                }
                gate += effect.gates();
            } else {
                let sum = sums.at(effect.port);
                sum.add(effect, &products);
                for (doubt, direction) in sum.doubts.iter_mut().zip(&self.model.doubt.directions) {
                    let weights = direction.get(first..).unwrap_or_default();
                    *doubt += products.iter().zip(weights).map(|(a, b)| a * f64::from(*b)).sum::<f64>();
                }
            }
            first += effect.count();
        }
        unknown
    }

    /// What the rates of change add to the bias now, °/h. A recording's first seconds, when no rate is known yet, are
    /// corrected by the first one.
    pub fn rates_deg_h(&self) -> f64 {
        self.rates_deg_h
    }
}

/// What is added at a port, and what one sigma along each uncertain direction adds there.
#[derive(Default)]
struct Sum {
    value: f64,
    doubts: [f64; MAX_DIRECTIONS],
}

impl Sum {
    fn add(&mut self, effect: &Effect, products: &[f64]) {
        self.value += effect.sum(products);
    }
}

/// The same at all ports.
#[derive(Default)]
struct Sums {
    rate: Sum,
    scale: Sum,
    index: Sum,
    forward: Sum,
    left: Sum,
}

impl Sums {
    fn at(&mut self, port: Port) -> &mut Sum {
        match port {
            Port::Rate => &mut self.rate,
            Port::Scale => &mut self.scale,
            Port::Index => &mut self.index,
            Port::Forward => &mut self.forward,
            Port::Left => &mut self.left,
        }
    }
}

impl ErrorModel {
    /// What the true rate x adds to itself, given the sum of both: the root of x + N(x) = sum by Newton's method.
    fn of_rate_deg_h(&self, sum_deg_h: f64) -> f64 {
        if self.rate_terms.is_empty() {
            return 0.0;
        }
        let added = |rate: f64| self.rate_terms.iter().map(|term| term.of_rate_deg_h(rate)).sum::<f64>();
        let mut rate = sum_deg_h;
        for _ in 0..NEWTON_STEPS {
            let missed = rate + added(rate) - sum_deg_h;
            let slope = 1.0 + (added(rate + SLOPE_DEG_H) - added(rate - SLOPE_DEG_H)) / (2.0 * SLOPE_DEG_H);
            // A gyro that turns back where its input goes on has no single answer there; the step stays bounded.
            rate -= missed / slope.max(LEAST_SLOPE);
            if missed.abs() < 1e-12 {
                break;
            }
        }
        sum_deg_h - rate
    }
}

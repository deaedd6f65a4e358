//! What may be proposed of these runs: signals, factors with the constants that the search begins with, and what a proposal costs.

use std::f64::consts::LN_2;
use std::sync::Arc;

use north_finder::effects::ChannelName;
use north_finder::effects::dynamics::Dynamics;
use north_finder::effects::effect::{Effect, MAX_FACTORS, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::part::Span;
use north_finder::effects::shape::{Circular, Harmonic, Shape, Sharp, Smooth};
use north_finder::effects::signal::{Channel, Difference, Signal, WeightedDifference};
use rayon::prelude::*;

use super::functions::Library;
use super::rows::Run;
use super::spans::IDENTITY;

/// Values of a constant that recordings tell apart: time constants from a few rows to a recording's length, by factors of two.
const VALUES_OF_A_CONSTANT: f64 = 8.0;
/// A place at which something jumps is tuned so much finer than other constants, up to its row, and is one of so many times as many values.
const FINENESS_OF_A_JUMP: f64 = 10.0;
/// Most channels of which differences are proposed: more would be more pairs than signals.
const MOST_PAIRED: usize = 6;

/// Most that an error of the index or of the level may be, root mean square, degrees and g: the equations are linear in it, and leave out e²/2 of the
/// rate, 0.4 % at 5°. What is larger is another effect, which this one stands for.
pub const MOST_INDEX_DEG: f64 = 5.0;
const MOST_LEVEL_G: f64 = 0.087;
/// Most that the scale factor may change by, root mean square.
const MOST_SCALE: f64 = 0.2;

/// The signals of some runs.
#[derive(Clone)]
pub struct Grammar {
    pub signals: Vec<(Signal, Span)>,
    /// Where effects may enter: of still recordings all but the rate is one with it. At the levels where the accelerometers are seen to err: what changes in a run would
    /// change their readings.
    pub ports: Vec<Port>,
    /// The same for constants: at the levels where they are measured.
    pub ports_of_constants: Vec<Port>,
    /// What is evaluated of factors.
    pub library: Arc<Library>,
}

impl Grammar {
    /// Of runs that all have the same channels.
    pub fn new(runs: &[Run], library: Library) -> Self {
        let library = Arc::new(library);
        let Some(first) = runs.first() else {
            return Self { signals: Vec::new(), ports: Vec::new(), ports_of_constants: Vec::new(), library };
        };
        let shared = |name: &&str| runs.iter().all(|run| run.channel_names().any(|each| each == *name));
        let names: Vec<ChannelName> = first.channel_names().filter(shared).filter_map(ChannelName::new).collect();
        let channels = names.iter().map(|&name| Channel { name }.into());
        let paired = if names.len() <= MOST_PAIRED { names.len() } else { 0 };
        let pairs = (0..paired).flat_map(|i| (0..i).map(move |j| (i, j)));
        let differences = pairs
            .filter(|&(i, j)| same_unit(names[i].as_str(), names[j].as_str()))
            .map(|(i, j)| Difference { plus: names[j], minus: names[i] }.into());
        let all: Vec<Signal> = Signal::without_channels().chain(channels).chain(differences).collect();
        let signals = all
            .into_par_iter()
            .filter_map(|signal| Some((signal, library.span(runs, &Factor::new(signal, &[], IDENTITY))?)))
            .collect();
        let ports_of_constants = ports(runs, runs.iter().all(Run::has_level));
        Self { signals, ports: ports_of_changes(runs), ports_of_constants, library }
    }

    /// What comes out of a signal's dynamics; `None` where it does not vary.
    pub fn span(&self, runs: &[Run], signal: Signal, dynamics: &[Dynamics]) -> Option<Span> {
        self.library.span(runs, &Factor::new(signal, dynamics, IDENTITY))
    }

    /// Every factor that stands alone: a signal behind at most one dynamics, in every shape of a bare signal, and as a line or a curve behind a
    /// dynamics.
    pub fn factors(&self, runs: &[Run]) -> Vec<Factor> {
        let of_signal = |(signal, span): &(Signal, Span)| {
            let mut factors: Vec<Factor> = Vec::new();
            if !signal.needs_dynamics() {
                Shape::starts(span, &mut |shape| factors.push(Factor::new(*signal, &[], shape)));
            }
            let mut behind: Vec<Dynamics> = Vec::new();
            if !signal.is_angle() && !signal.is_time() {
                Dynamics::starts(span, &mut |dynamics| behind.push(dynamics));
            }
            let curves = behind.into_par_iter().flat_map_iter(|each| self.curves(runs, *signal, &[each], false));
            factors.extend(curves.collect::<Vec<Factor>>());
            factors
        };
        self.signals.par_iter().flat_map_iter(of_signal).collect()
    }

    /// A signal behind dynamics as a line and as a smooth curve, of few functions for products.
    pub fn curves(&self, runs: &[Run], signal: Signal, dynamics: &[Dynamics], of_few: bool) -> Vec<Factor> {
        let mut curves = Vec::new();
        if let Some(behind) = self.span(runs, signal, dynamics) {
            Shape::starts(&behind, &mut |shape| {
                let is_curve = match shape {
                    Shape::Linear(_) => true,
                    Shape::Smooth(smooth) => smooth.is_of_few() == of_few,
                    _ => false,
                };
                if is_curve {
                    curves.push(Factor::new(signal, dynamics, shape));
                }
            });
        }
        curves
    }

    /// Signals to try in the place of one: of a channel its weighted difference and sum with every other one, each weighed by how much it varies; of a
    /// difference its first channel alone.
    fn beside(&self, signal: Signal) -> Vec<Signal> {
        let channel = |signal: Signal| match signal {
            Signal::Channel(Channel { name }) => Some(name),
            _ => None,
        };
        let of_channels = || self.signals.iter().filter_map(|(signal, span)| Some((channel(*signal)?, span)));
        let Some(plus) = channel(signal) else {
            let first = signal.channels().next().copied();
            return first.map(|name| Channel { name }.into()).into_iter().collect();
        };
        let Some((_, own)) = of_channels().find(|(name, _)| *name == plus) else { return Vec::new() };
        let joined = |(minus, span): (ChannelName, &Span)| {
            let ratio = own.deviation / span.deviation;
            [ratio, -ratio].map(|ratio| {
                WeightedDifference { plus, minus, ratio: ratio as f32, reference: span.mean as f32 }.into()
            })
        };
        of_channels().filter(|(name, _)| *name != plus).flat_map(joined).collect()
    }

    /// Minus the logarithm of the probability of an effect's form before anything is seen, nats.
    pub fn cost(&self, effect: &Effect) -> f64 {
        form_cost(effect, self.signals.len())
    }
}

/// The same where there are so many signals. Ports, numbers of factors, signals, dynamics and shapes are drawn one after the other, the plain ones half
/// of the time.
pub fn form_cost(effect: &Effect, signals: usize) -> f64 {
    let port = if effect.port == Port::Rate { LN_2 } else { LN_2 + (Port::ALL.len() as f64 - 1.0).ln() };
    let number = LN_2 * effect.factors.len().max(1) as f64;
    let of_factor = |factor: &Factor| {
        // Of a weighted difference the second channel is chosen as the first one.
        let signal = (signals as f64).ln() * if factor.signal.constant().is_some() { 2.0 } else { 1.0 };
        let kinds = |of_plain: bool, others: f64| if of_plain { LN_2 } else { LN_2 + others.ln() };
        let dynamics: f64 = factor.dynamics.iter().map(|_| kinds(false, Dynamics::KINDS as f64)).sum::<f64>() + LN_2;
        let shape = kinds(matches!(factor.shape, Shape::Linear(_)), Shape::KINDS as f64 - 1.0);
        signal + dynamics + shape + cost_of_constants(factor)
    };
    port + number + effect.factors.iter().map(of_factor).sum::<f64>()
}

/// Every tuned constant is one of so many values; a harmonic's order, which positions of an index may take for another, is a lower one half of the time.
fn cost_of_constants(factor: &Factor) -> f64 {
    let of_order = match factor.shape {
        Shape::Harmonic(Harmonic { period }) if factor.signal.is_angle() => {
            LN_2 * (360.0 / f64::from(period) - 1.0).max(0.0)
        }
        _ => 0.0,
    };
    of_order + fineness(factor).ln() + VALUES_OF_A_CONSTANT.ln() * factor.constants().len() as f64
}

/// How much finer than others the constants of a factor are tuned.
pub fn fineness(factor: &Factor) -> f64 {
    if factor.shape.jumps() || factor.dynamics.iter().any(Dynamics::jumps) { FINENESS_OF_A_JUMP } else { 1.0 }
}

/// The part of a form's cost that any form as complex has, nats: how many factors, dynamics and tuned constants there are, whichever they are. The rest
/// guards the search against chance; once there is an effect, it is no knowledge of which of two as complex forms it is.
pub fn complexity(effect: &Effect) -> f64 {
    let of_factor = |factor: &Factor| LN_2 * factor.dynamics.len() as f64 + cost_of_constants(factor);
    LN_2 * effect.factors.len().max(1) as f64 + effect.factors.iter().map(of_factor).sum::<f64>()
}

/// Where what changes in a run may enter.
pub fn ports_of_changes(runs: &[Run]) -> Vec<Port> {
    ports(runs, runs.iter().any(Run::level_errs))
}

/// The ports of these runs, the levels only where they count.
fn ports(runs: &[Run], levelled: bool) -> Vec<Port> {
    let still = runs.iter().all(|run| run.still);
    let is_one = |port: &Port| match port {
        Port::Rate => true,
        Port::Scale | Port::Index => !still,
        Port::Forward | Port::Left => !still && levelled,
    };
    Port::ALL.into_iter().filter(is_one).collect()
}

/// Most that errors of a port may be, root mean square.
pub fn largest(port: Port) -> f64 {
    match port {
        Port::Rate => f64::INFINITY,
        Port::Scale => MOST_SCALE,
        Port::Index => MOST_INDEX_DEG,
        Port::Forward | Port::Left => MOST_LEVEL_G,
    }
}

/// Channels of one unit, by the last word of their names.
fn same_unit(a: &str, b: &str) -> bool {
    let unit = |name: &str| name.rsplit('_').next().unwrap_or_default().to_owned();
    unit(a) == unit(b)
}

/// Forms of the same signals and dynamics: with or without a factor's constant, of a signal's weighted difference with another, at another port, or with one factor
/// less.
pub fn reshaped(effect: &Effect, grammar: &Grammar, runs: &[Run]) -> Vec<Effect> {
    let others = grammar.ports.iter().filter(|&&port| port != effect.port);
    let mut all = reduced(effect);
    all.extend(others.filter_map(|&port| varied(effect, port, effect.factors.to_vec())));
    for (f, own) in effect.factors.iter().enumerate() {
        all.extend(replaced(effect, f, Factor { constant: !own.constant, ..own.clone() }));
        let signals = grammar.beside(own.signal).into_iter();
        let of_others = signals.filter_map(|signal| relined(own, signal, &own.dynamics, grammar, runs));
        all.extend(of_others.filter_map(|factor| replaced(effect, f, factor)));
    }
    all
}

/// An effect of the scale factor as one of the rate, which then is its last factor: behind dynamics the rate makes another effect.
pub fn of_rate(effect: &Effect) -> Option<Effect> {
    let rate = Factor::new(Signal::Rate, &[], IDENTITY);
    let factors = [effect.factors.as_slice(), &[rate]].concat();
    (effect.port == Port::Scale).then(|| varied(effect, Port::Rate, factors)).flatten()
}

/// Forms with other dynamics, none to two with the constants that the search begins with, in the place of one factor's.
pub fn redriven(effect: &Effect, f: usize, grammar: &Grammar, runs: &[Run]) -> Vec<Effect> {
    let own = &effect.factors[f];
    let span = grammar.span(runs, own.signal, &[]);
    let Some(bare) = span.filter(|bare| !bare.is_angle && !bare.is_time) else { return Vec::new() };
    let mut chains: Vec<Vec<Dynamics>> = vec![Vec::new()];
    let mut number = 0;
    Dynamics::starts(&bare, &mut |each| {
        chains.push(vec![each]);
        // A second dynamics is tuned when it is found: every other of its constants will do. Only what is linear makes more of its own output.
        number += 1;
        let goes_behind =
            |first: &Dynamics| first.is_linear() || std::mem::discriminant(first) != std::mem::discriminant(&each);
        if let [first] = own.dynamics.as_slice()
            && number % 2 == 0
            && goes_behind(first)
        {
            chains.push(vec![*first, each]);
        }
    });
    let behind_others = chains.par_iter().filter_map(|chain| relined(own, own.signal, chain, grammar, runs));
    behind_others.filter_map(|factor| replaced(effect, f, factor)).collect()
}

/// A factor's shape behind other dynamics, or of another signal: a curve keeps its kind, with an interval of its own.
fn relined(own: &Factor, signal: Signal, dynamics: &[Dynamics], grammar: &Grammar, runs: &[Run]) -> Option<Factor> {
    let behind = grammar.span(runs, signal, dynamics)?;
    let mut shape = None;
    Shape::starts(&behind, &mut |each| {
        if shape.is_none() && std::mem::discriminant(&each) == std::mem::discriminant(&own.shape) {
            shape = Some(each);
        }
    });
    let shape = match (shape?, own.shape) {
        (Shape::Smooth(Smooth { low, high, .. }), Shape::Smooth(Smooth { count, .. })) => {
            Smooth { low, high, count }.into()
        }
        (shape, _) => shape,
    };
    Some(Factor { constant: own.constant, ..Factor::new(signal, dynamics, shape) })
}

/// The form with another factor in the place of one.
pub fn replaced(effect: &Effect, f: usize, factor: Factor) -> Option<Effect> {
    let mut factors: Vec<Factor> = effect.factors.to_vec();
    factors[f] = factor;
    varied(effect, effect.port, factors)
}

/// Forms with one factor less.
pub fn reduced(effect: &Effect) -> Vec<Effect> {
    let without = |i: usize| {
        let mut factors: Vec<Factor> = effect.factors.to_vec();
        factors.remove(i);
        varied(effect, effect.port, factors)
    };
    (0..effect.factors.len()).filter_map(without).collect()
}

/// Forms with one factor more.
pub fn extended(effect: &Effect, further: &[Factor]) -> Vec<Effect> {
    let beside: Vec<Factor> = effect.factors.iter().cloned().map(Factor::with_constant).collect();
    let lean: Vec<Factor> = beside.iter().map(lean).collect();
    let with = |factor: &Factor| {
        [&beside, &lean].map(|own| varied(effect, effect.port, [own.as_slice(), std::slice::from_ref(factor)].concat()))
    };
    further.iter().flat_map(with).flatten().collect()
}

/// Another form, if it is valid and another. Constants stand in products: by itself a factor's constant is the port's, which is proposed by itself.
fn varied(effect: &Effect, port: Port, mut factors: Vec<Factor>) -> Option<Effect> {
    if factors.len() > MAX_FACTORS {
        return None;
    }
    if let [one] = factors.as_mut_slice() {
        one.constant = false;
    }
    let each = Effect::new(port, &factors);
    (each.validate().is_ok() && each != *effect).then_some(each)
}

/// A factor with fewer functions, so that products of three have room.
fn lean(factor: &Factor) -> Factor {
    let shape = match factor.shape {
        Shape::Smooth(Smooth { low, high, .. }) | Shape::Sharp(Sharp { low, high }) => Smooth::of_few(low, high).into(),
        Shape::Circular(_) => Circular::of_few().into(),
        shape => shape,
    };
    Factor { shape, ..factor.clone() }
}

//! An effect: a product of factors at a port, with a weight for every product of their functions.

use core::fmt;

use heapless::Vec;
use quantities::limits::{Invalid, finite, within};
use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::factor::{Factor, Functions, Memory};
use super::now::Now;
use super::shape::Shape;
use super::signal::Signal;
use crate::bounded::bounded;
use crate::earth::EARTH_RATE_DEG_H;
use crate::units::DEG_PER_RAD;

/// Most factors of one effect.
pub const MAX_FACTORS: usize = 3;
/// Most weights of one effect: a surface of two smooth curves with their constants has 49, a product of three of few functions 64.
pub const MAX_EFFECT_WEIGHTS: usize = 64;

/// Products of the functions of an effect's factors.
pub type Products = Vec<f64, MAX_EFFECT_WEIGHTS>;
/// What the factors of one effect remember.
pub type Memories = [Memory; MAX_FACTORS];
/// Functions of those of its factors that are replayed ([`Factor::is_replayed`]), in the place of each factor.
pub type Replayed = [Functions; MAX_FACTORS];

/// Where an effect enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Port {
    /// Adds to the rate, °/h.
    Rate,
    /// Scales the rate: adds to the scale factor, 1.
    Scale,
    /// Turns the index angle: adds to what the encoder reads, degrees.
    Index,
    /// Adds to the forward level accelerometer's reading, g.
    Forward,
    /// Adds to the left level accelerometer's reading, g.
    Left,
}

impl Port {
    pub const ALL: [Self; 5] = [Self::Rate, Self::Scale, Self::Index, Self::Forward, Self::Left];

    /// Unit of a weight.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Rate => "deg_h",
            Self::Scale => "1",
            Self::Index => "deg",
            Self::Forward | Self::Left => "g",
        }
    }

    /// What adds 1 °/h to a rate as great as the Earth's, in the unit of a weight: as a share, as an angle across the axis, or by a tilt that takes in the
    /// vertical rate.
    pub fn per_deg_h(self) -> f64 {
        match self {
            Self::Rate => 1.0,
            Self::Scale | Self::Forward | Self::Left => 1.0 / EARTH_RATE_DEG_H,
            Self::Index => DEG_PER_RAD / EARTH_RATE_DEG_H,
        }
    }
}

/// Σ weight · product of the factors' functions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    pub port: Port,
    /// One to three; none: a constant.
    #[serde(default)]
    pub factors: Vec<Factor, MAX_FACTORS>,
    /// One for every product of functions: the first function of the first factor with all of the others comes first.
    pub weights: Vec<f32, MAX_EFFECT_WEIGHTS>,
}

impl Effect {
    /// An effect whose weights are not known yet: all 0.
    pub fn new(port: Port, factors: &[Factor]) -> Self {
        let factors = bounded(factors.iter().cloned());
        let mut effect = Self { port, factors, weights: Vec::new() };
        effect.weights = bounded(core::iter::repeat_n(0.0, effect.count()));
        effect
    }

    /// How many weights there must be.
    pub fn count(&self) -> usize {
        self.factors.iter().map(Factor::count).product()
    }

    /// The products of the functions of its factors in this second: of all of them, or where it depends on the azimuth of those factors that do
    /// not ([`Self::of_azimuth`] gives the others). Empty where a signal says nothing, or where what it does
    /// is not known yet ([`Self::is_read`]). Must be called every second, in the order of time.
    pub fn products(&self, now: &Now<'_>, memories: &mut Memories) -> Products {
        let mut products: Products = bounded([1.0]);
        for (factor, memory) in self.factors.iter().zip(memories) {
            if factor.needs_azimuth() {
                continue;
            }
            // Every factor is asked, so that every one remembers.
            let input = factor.pass(factor.signal.value(now), now.track.step_s, memory);
            let values = input.map(|input| factor.values(input)).unwrap_or_default();
            products = bounded(products.iter().flat_map(|product| values.iter().map(move |value| product * value)));
        }
        products
    }

    /// What it adds at its port, of its products.
    pub fn sum(&self, products: &[f64]) -> f64 {
        products.iter().zip(&self.weights).map(|(a, b)| a * f64::from(*b)).sum()
    }

    /// All its signals say something in this second.
    pub fn is_read(&self, now: &Now<'_>) -> bool {
        let says = |factor: &Factor| {
            if factor.needs_azimuth() { now.conditions.index.is_some() } else { factor.signal.value(now).is_some() }
        };
        self.factors.iter().all(says)
    }

    /// The product of functions that a weight belongs to: of those factors that depend on the azimuth, of which `now` and `replayed` say what they are, and of
    /// the others by the means of their products ([`Self::products`], by number). 0 where a signal says nothing.
    pub fn of_azimuth(&self, number: usize, gate: &dyn Fn(usize) -> f64, replayed: &Replayed, now: &Now<'_>) -> f64 {
        let (mut rest, mut product) = (number, 1.0);
        let (mut first, mut stride) = (0, 1);
        for (factor, replayed) in self.factors.iter().zip(replayed).rev() {
            let count = factor.count().max(1);
            let function = rest % count;
            rest /= count;
            if factor.is_replayed() {
                product *= replayed.get(function).copied().unwrap_or(0.0);
            } else if factor.needs_azimuth() {
                let value = factor.signal.value(now).and_then(|x| factor.values(x).get(function).copied());
                product *= value.unwrap_or(0.0);
            } else {
                first += stride * function;
            }
            stride *= Self::gates_of(factor);
        }
        product * gate(first)
    }

    /// Standard deviation of a weight before anything is learned, relative to the effect's size.
    pub fn prior(&self, number: usize) -> f64 {
        let of_functions: f64 = self.functions_of(number).map(|(factor, function)| factor.prior(function)).product();
        of_functions * self.of_surface(number)
    }

    /// By how much the prior of a weight is wider than the product of its functions' priors. A smooth surface has no direction of its own: variances fall with the fourth
    /// power of its frequency, the root of the mean of j² over the curves that take part, where a product of curves is shrunk by the fourth power of each one's j.
    pub fn of_surface(&self, number: usize) -> f64 {
        let (mut curves, mut sum, mut product) = (0.0, 0.0, 1.0);
        for (factor, function) in self.functions_of(number) {
            if matches!(factor.shape, Shape::Smooth(_)) && function >= usize::from(factor.constant) {
                let j2 = 1.0 / factor.prior(function);
                curves += 1.0;
                sum += j2;
                product *= j2;
            }
        }
        if curves > 1.0 { product * curves / sum } else { 1.0 }
    }

    /// The factors, the last first, each with the number of its function in the product that a weight belongs to.
    fn functions_of(&self, number: usize) -> impl Iterator<Item = (&Factor, usize)> {
        let mut rest = number;
        self.factors.iter().rev().map(move |factor| {
            let count = factor.count().max(1);
            let function = rest % count;
            rest /= count;
            (factor, function)
        })
    }

    /// How many products there are in [`Self::products`] of an effect that depends on the azimuth.
    pub fn gates(&self) -> usize {
        self.factors.iter().map(Self::gates_of).product()
    }

    fn gates_of(factor: &Factor) -> usize {
        if factor.needs_azimuth() { 1 } else { factor.count() }
    }

    /// It depends on the azimuth that is sought.
    pub fn needs_azimuth(&self) -> bool {
        self.factors.iter().any(Factor::needs_azimuth)
    }

    /// It depends on the level accelerometers, or corrects them.
    pub fn needs_level(&self) -> bool {
        let follows = |factor: &Factor| matches!(factor.signal, Signal::TiltAlong | Signal::TiltAcross);
        matches!(self.port, Port::Forward | Port::Left) || self.factors.iter().any(follows)
    }

    /// An error of the encoder that is known from where it stands, whenever that is.
    pub fn follows_index_alone(&self) -> bool {
        let is_of_index = |factor: &Factor| factor.signal == Signal::Index && factor.dynamics.is_empty();
        self.port == Port::Index && !self.factors.is_empty() && self.factors.iter().all(is_of_index)
    }

    pub fn channels(&self) -> impl Iterator<Item = &ChannelName> {
        self.factors.iter().flat_map(Factor::channels)
    }

    /// Every part in its range, and as many weights as products of functions.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.factors.iter().try_for_each(Factor::validate)?;
        let count = self.count() as f64;
        within("model.effects (functions)", count, 1.0, MAX_EFFECT_WEIGHTS as f64, "at most 64 products of functions")?;
        if self.weights.len() != self.count() {
            let (field, value) = ("model.effects.weights (number)", self.weights.len() as f64);
            return Err(Invalid::new(field, value, "one for every product of the factors' functions"));
        }
        self.weights.iter().try_for_each(|&weight| finite("model.effects.weights", &[weight.into()]))
    }
}

/// The stable name: the port where it is not the rate, then the factors.
impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.port {
            Port::Rate if self.factors.is_empty() => "bias",
            Port::Rate => "",
            Port::Scale => "scale",
            Port::Index => "index-offset",
            Port::Forward => "level-forward",
            Port::Left => "level-left",
        })?;
        for (i, factor) in self.factors.iter().enumerate() {
            let joint = if i > 0 {
                "-times-"
            } else if self.port == Port::Rate {
                ""
            } else {
                "-by-"
            };
            write!(f, "{joint}{factor}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::shape::{Decay, Smooth};
    use crate::effects::signal::{Channel, Since};

    /// A smooth curve of six functions times a decay: six weights, whose priors fall with the square of the number; named by port and factors.
    #[test]
    fn a_product_at_a_port() {
        let name = ChannelName::new("supply_v").unwrap();
        let curve = Factor::new(Channel { name }.into(), &[], Smooth { low: 4.0, high: 6.0, count: 6 }.into());
        let decay = Factor::new(Since.into(), &[], Decay { tau_s: 10.0 }.into());
        let effect = Effect::new(Port::Scale, &[decay, curve]);
        assert_eq!((effect.count(), effect.weights.len()), (6, 6));
        assert_eq!((effect.prior(0), effect.prior(2)), (1.0, 1.0 / 9.0));
        assert_eq!(std::format!("{effect}"), "scale-by-since-decay-times-supply_v-smooth");
        assert!(effect.validate().is_ok() && !effect.needs_azimuth());
    }

    /// Of two curves of three functions beside constants: each curve by itself 1/j²; together the mean of both j²: of 1 and 1 it is 1, of 1 and 9 it is 5, of 9 and 9
    /// it is 9, where the product of the curves' priors would be 1/81. A decay times a curve is no surface.
    #[test]
    fn a_surface_is_as_smooth_in_every_direction() {
        let curve = Factor::new(Since.into(), &[], Smooth { low: 0.0, high: 1.0, count: 3 }.into()).with_constant();
        let surface = Effect::new(Port::Rate, &[curve.clone(), curve.clone()]);
        for (number, expected) in [(0, 1.0), (3, 1.0 / 9.0), (12, 1.0 / 9.0), (5, 1.0), (7, 0.2), (15, 1.0 / 9.0)] {
            assert!((surface.prior(number) - expected).abs() < 1e-12, "{number}: {}", surface.prior(number));
        }
        let decay = Factor::new(Since.into(), &[], Decay { tau_s: 10.0 }.into()).with_constant();
        assert_eq!(Effect::new(Port::Rate, &[decay, curve]).of_surface(7), 1.0);
    }

    #[test]
    fn weights_must_be_as_many_as_products() {
        let decay = Factor::new(Since.into(), &[], Decay { tau_s: 10.0 }.into());
        let mut effect = Effect::new(Port::Rate, &[decay]);
        assert!(effect.weights.push(1.0).is_ok());
        assert_eq!(effect.validate().unwrap_err().field, "model.effects.weights (number)");
    }
}

//! The error model: what a calibration knows of the gyro, taken out of every second.
//!
//! raw rate = (1 + scale error + Σ terms that scale + Σ effects at the scale factor) · true rate + bias + Σ other terms + Σ effects at the rate + what the
//! rate does to itself, in °/h. The index angle and the levels are corrected second by second, by effects at their ports too, and the azimuth by the
//! Earth's field at the end. An [`Evaluator`] runs it; what it needs of a second is [`Conditions`].

pub mod base_motion;
pub mod basis;
pub mod carried;
pub mod channel;
mod conditions;
pub mod doubt;
pub mod dynamics;
pub mod earth_field;
pub mod effect;
mod evaluator;
pub mod factor;
pub mod index_error;
mod moves;
pub mod now;
pub mod part;
pub mod plausible;
pub mod rate_term;
pub mod shape;
pub mod signal;
pub mod sinusoid;
pub mod term;
pub mod track;
mod window;

pub use base_motion::BaseMotion;
pub use basis::Basis;
pub use carried::Carried;
pub use channel::{ChannelName, MAX_CHANNELS};
pub use conditions::Conditions;
pub use doubt::Doubt;
pub use earth_field::EarthField;
pub use effect::Effect;
pub use evaluator::{Correction, Evaluator};
pub use index_error::IndexError;
pub use plausible::Plausible;
pub use rate_term::RateTerm;
pub use sinusoid::Sinusoid;
pub use term::Term;

use heapless::Vec;
use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

use crate::earth::EarthRate;
use crate::sensing::index::Direction;
use carried::MAX_GATES;
use doubt::MAX_COEFFICIENTS;
use effect::{Memories, Port};
use now::{Now, RunFacts};
use signal::Signal;
use track::Track;

/// Most additive terms, products of two bases among them, and effects of the rate.
pub const MAX_TERMS: usize = 12;
pub const MAX_PRODUCTS: usize = 4;
pub const MAX_RATE_TERMS: usize = 4;
/// Most channels whose past is kept, each with its own low-pass.
pub const MAX_WINDOWS: usize = 4;
/// Most knots of all curves together.
pub const MAX_KNOTS: usize = 48;
/// Most effects, and most factors of all of them together.
pub const MAX_EFFECTS: usize = 8;
pub const MAX_ALL_FACTORS: usize = 24;

/// Names of what is known of a run as a whole.
pub const HOUR_OF_DAY: &str = "time of day";
pub const REST_BEFORE: &str = "rest before the run";

/// A calibration: immutable input.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ErrorModel {
    /// Scale factor error, dimensionless, −0.1 … 0.1: raw rate = (1 + this) · true rate + ….
    pub scale_error: f64,
    /// Bias, °/h.
    pub bias_deg_h: f64,
    /// By how much the level accelerometers change in a fix while the base stands, arcsec: changes up to twice that are no motion of the base. 0: none that is
    /// known.
    pub level_drift_arcsec: f64,
    /// Readings that can be, of channels whose sensors were seen to fail for a moment.
    pub plausible: Vec<Plausible, MAX_WINDOWS>,
    /// What adds to the rate, or to the scale factor.
    pub terms: Vec<Term, MAX_TERMS>,
    /// What the gyro makes of the rate beyond its scale factor.
    pub rate_terms: Vec<RateTerm, MAX_RATE_TERMS>,
    pub index_error: Option<IndexError>,
    pub earth_field: Option<EarthField>,
    pub base_motion: Option<BaseMotion>,
    pub sinusoid: Option<Sinusoid>,
    /// Products of factors at a port: what the diagnosis learns beyond the terms.
    pub effects: Vec<Effect, MAX_EFFECTS>,
    /// How far the model itself may be wrong.
    pub doubt: Doubt,
}

/// A model has no room for one part more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooMany;

impl ErrorModel {
    /// Takes a term up.
    ///
    /// Errors: there are [`MAX_TERMS`] already.
    pub fn add(&mut self, term: Term) -> Result<(), TooMany> {
        self.terms.push(term).map_err(|_| TooMany)
    }

    /// Takes an effect of the rate up.
    ///
    /// Errors: there are [`MAX_RATE_TERMS`] already.
    pub fn add_rate_term(&mut self, term: RateTerm) -> Result<(), TooMany> {
        self.rate_terms.push(term).map_err(|_| TooMany)
    }

    fn bases(&self) -> impl Iterator<Item = &Basis> {
        self.terms.iter().flat_map(Term::bases)
    }

    /// All channels that terms and effects follow, as often as they do.
    fn followed(&self) -> impl Iterator<Item = &ChannelName> {
        self.terms.iter().flat_map(Term::channels).chain(self.effects.iter().flat_map(Effect::channels))
    }

    /// How many coefficients the terms have.
    fn coefficients(&self) -> usize {
        self.terms.iter().map(|term| term.coefficients.len()).sum()
    }

    /// Effects that depend on the azimuth that is sought, each with the number of its first weight among all coefficients and weights, and the number
    /// of its first gate.
    pub fn effects_of_azimuth(&self) -> impl Iterator<Item = (&Effect, usize, usize)> {
        let (mut first, mut gate) = (self.coefficients(), 0);
        self.effects.iter().filter_map(move |effect| {
            let own = (effect, first, gate);
            first += effect.count();
            effect.needs_azimuth().then(|| {
                gate += effect.gates();
                own
            })
        })
    }

    /// What it adds depends on the azimuth that is sought, or how uncertain it is does.
    pub fn needs_azimuth(&self) -> bool {
        let of_process = self.doubt.process.is_some_and(|process| process.port != Port::Rate);
        let is_of = |effect: &Effect| effect.needs_azimuth() || !matches!(effect.port, Port::Rate | Port::Scale);
        of_process || self.effects.iter().any(is_of)
    }

    /// An effect follows the rate behind dynamics, so that it changes within a dwell and is not known before there is an azimuth.
    pub fn remembers_rate(&self) -> bool {
        self.effects.iter().flat_map(|effect| &effect.factors).any(|factor| factor.is_replayed() && factor.takes_time())
    }

    /// The signals of a run as a whole that effects depend on, by name: time of day, rest before the run.
    pub fn facts_of_runs(&self) -> impl Iterator<Item = &'static str> {
        let follows =
            |wanted: Signal| self.effects.iter().flat_map(|effect| &effect.factors).any(|each| each.signal == wanted);
        [(Signal::Hour, HOUR_OF_DAY), (Signal::Rest, REST_BEFORE)]
            .into_iter()
            .filter_map(move |(signal, name)| follows(signal).then_some(name))
    }

    fn windows(&self) -> impl Iterator<Item = (&ChannelName, f32)> {
        self.bases().filter_map(Basis::window)
    }

    /// Names of the channels beyond temperature and level, each once, in the order of the terms.
    pub fn channels(&self) -> Vec<ChannelName, MAX_CHANNELS> {
        let mut names = Vec::new();
        for name in self.followed().filter(|name| !name.is_in_every_second()) {
            if !names.contains(name) {
                let _ = names.push(*name);
            }
        }
        names
    }

    /// The first channel that a board does not measure, which measures these beyond those of every second: a model with one is for recordings only.
    pub fn off_board(&self, measured: &[ChannelName]) -> Option<ChannelName> {
        self.channels().iter().find(|name| !name.is_on_board(measured)).copied()
    }

    /// The place of the inertial block's temperature among [`Self::channels`], if it is followed.
    pub fn block_temperature(&self) -> Option<usize> {
        self.channels().iter().position(|name| name.as_str() == channel::BLOCK_TEMPERATURE)
    }

    /// The first of the board's own channels that it cannot do without and that is not there.
    pub fn lacks(&self, has_temperature: bool, has_level: bool) -> Option<&'static str> {
        let follows = |wanted: &str| self.followed().any(|name| name.as_str() == wanted);
        let of_effects = self.effects.iter().any(Effect::needs_level);
        let level = self.base_motion.is_some() || of_effects || follows(channel::FORWARD) || follows(channel::LEFT);
        if follows(channel::TEMPERATURE) && !has_temperature {
            return Some(channel::TEMPERATURE);
        }
        (level && !has_level).then_some(channel::FORWARD)
    }

    /// Whether the model says how the bias follows the temperature.
    pub fn covers_temperature(&self) -> bool {
        let follows = |term: &Term| term.channels().any(|name| name.as_str() == channel::TEMPERATURE);
        let of_effect = |effect: &Effect| {
            effect.port == Port::Rate && effect.channels().any(|name| name.as_str() == channel::TEMPERATURE)
        };
        self.terms.iter().any(|term| !term.scales && follows(term)) || self.effects.iter().any(of_effect)
    }

    /// True direction of the index from the measured one.
    pub fn true_index(&self, index: Direction) -> Direction {
        self.index_error.map_or(index, |error| error.true_index(index))
    }

    /// By how much the encoder reads too large here, degrees, as far as that follows the angle alone: the periodic part of the index error, and the effects at the
    /// index whose only signal is the index, without dynamics. An error that is the same everywhere is not in it.
    pub fn index_error_here_deg(&self, read_deg: f64) -> f64 {
        let of_index = || self.effects.iter().filter(|effect| effect.follows_index_alone());
        if self.index_error.is_none() && of_index().next().is_none() {
            return 0.0;
        }
        let reading = Direction::of_deg(read_deg);
        let conditions = Conditions { index: Some(reading), ..Conditions::default() };
        let now = Now {
            conditions: &conditions,
            channels: &[],
            track: &Track::default(),
            run: &RunFacts::default(),
            belief: None,
        };
        let of_effect = |effect: &Effect| effect.sum(&effect.products(&now, &mut Memories::default()));
        of_index().map(of_effect).sum::<f64>() + self.index_error.map_or(0.0, |error| error.periodic_deg(reading))
    }

    /// True azimuth from the one that the rates gave.
    pub fn true_azimuth_deg(&self, azimuth_deg: f64, earth: &EarthRate) -> f64 {
        self.earth_field.map_or(azimuth_deg, |field| field.true_azimuth_deg(azimuth_deg, earth))
    }

    /// All finite and in range; the scale factor within 10 % of one; as much as a board can hold.
    pub fn validate(&self) -> Result<(), Invalid> {
        within("model.scale_error", self.scale_error, -0.1, 0.1, "-0.1 to 0.1")?;
        within("model.bias_deg_h", self.bias_deg_h, -1e5, 1e5, "-1e5 to 1e5")?;
        within("model.level_drift_arcsec", self.level_drift_arcsec, 0.0, 36_000.0, "0 to 36000 (10 degrees)")?;
        self.plausible.iter().try_for_each(Plausible::validate)?;
        self.terms.iter().try_for_each(Term::validate)?;
        self.rate_terms.iter().try_for_each(RateTerm::validate)?;
        self.index_error.as_ref().map_or(Ok(()), IndexError::validate)?;
        self.earth_field.as_ref().map_or(Ok(()), EarthField::validate)?;
        self.base_motion.as_ref().map_or(Ok(()), BaseMotion::validate)?;
        self.sinusoid.as_ref().map_or(Ok(()), Sinusoid::validate)?;
        self.effects.iter().try_for_each(Effect::validate)?;
        let coefficients = self.coefficients() + self.effects.iter().map(Effect::count).sum::<usize>();
        self.doubt.validate(coefficients)?;
        let at_most =
            |what, number: usize, most: usize, allowed| within(what, number as f64, 0.0, most as f64, allowed);
        at_most("model (coefficients)", coefficients, MAX_COEFFICIENTS, "at most 96 coefficients and weights")?;
        let factors = self.effects.iter().map(|effect| effect.factors.len()).sum();
        at_most("model.effects (factors)", factors, MAX_ALL_FACTORS, "at most 24 factors")?;
        let gates = self.effects_of_azimuth().map(|(effect, ..)| effect.gates()).sum();
        let allowed = "at most 16 products of factors beside those that depend on the azimuth";
        at_most("model.effects (gates)", gates, MAX_GATES, allowed)?;
        let products = self.terms.iter().filter(|term| term.times.is_some()).count();
        at_most("model.terms (products)", products, MAX_PRODUCTS, "at most 4 products")?;
        at_most("model.terms (knots)", self.bases().map(Basis::knots).sum(), MAX_KNOTS, "at most 48 knots")?;
        let known = self.channels();
        let extra = self.followed().filter(|name| !name.is_in_every_second() && !known.contains(name)).count();
        at_most("model.terms (channels)", known.len() + extra, MAX_CHANNELS, "at most 8 channels")?;
        let past = |(i, window)| !self.windows().take(i).any(|other| other == window);
        let windows = self.windows().enumerate().filter(|&each| past(each)).count();
        let allowed = "at most 4 lags and rates of different channels or low-passes";
        at_most("model.terms (pasts)", windows, MAX_WINDOWS, allowed)
    }
}

/// A first-order low-pass: what was, what comes in, after `step_s`; a time constant of 0 passes everything.
fn low_pass(last: f64, value: f64, step_s: f64, tau_s: f64) -> f64 {
    if tau_s > 0.0 { last + (value - last) * dynamics::share(step_s, tau_s) } else { value }
}

#[cfg(test)]
mod tests;

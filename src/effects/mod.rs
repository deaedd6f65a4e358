//! The error model: what a calibration knows of the gyro, taken out of every second.
//!
//! raw rate = (1 + scale error) · true rate + bias + Σ terms, all rates in °/h. An [`Evaluator`] runs it; what it needs
//! of a second is [`Conditions`].

pub mod channel;
mod conditions;
mod evaluator;
pub mod spline;
mod term;

pub use channel::{ChannelName, MAX_CHANNELS};
pub use conditions::{Conditions, History, Move, Travel};
pub use evaluator::Evaluator;
pub use term::{DeadZoneForm, Term};

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::limits::Invalid;

/// Most terms that a model can have.
pub const MAX_TERMS: usize = 16;

/// A calibration: immutable input.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ErrorModel {
    /// Scale factor error, dimensionless, −0.1 … 0.1: raw rate = (1 + this) · true rate + ….
    pub scale_error: f64,
    /// Bias, °/h.
    pub bias_deg_h: f64,
    /// Effects beyond bias and scale.
    pub terms: Vec<Term, MAX_TERMS>,
}

/// The model in one second: what turns a raw rate into a true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    pub bias_deg_h: f64,
    /// One plus the scale factor error.
    pub scale: f64,
    /// A rate of change is not known yet and is missing from the bias.
    pub waiting: bool,
}

impl Correction {
    /// True angle increment, arcsec, of a raw one over `seconds`.
    pub fn apply(&self, increment_arcsec: f64, seconds: f64) -> f64 {
        (increment_arcsec - self.bias_deg_h * seconds) / self.scale
    }
}

/// A line with what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeLine {
    pub period_s: f64,
    /// Typical amplitude, °/h.
    pub amplitude_deg_h: f64,
}

/// How the accelerometers feel the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensing {
    /// Their noise is white in the velocity, not in the tilt.
    pub velocity: bool,
    /// Their readings come this much later than the gyro's, seconds: a filter, or (below 0) readings of the end of a row
    /// instead of means over it.
    pub lag_s: f64,
}

impl ErrorModel {
    /// Names of the channels beyond temperature and level, each once, in the order of the terms.
    pub fn channels(&self) -> Vec<ChannelName, MAX_CHANNELS> {
        let mut names = Vec::new();
        for name in self.terms.iter().filter_map(Term::channel).filter(|name| !name.is_on_board()) {
            if !names.contains(&name) {
                let _ = names.push(name);
            }
        }
        names
    }

    /// The first channel that no board measures: a model with one is for recordings only.
    pub fn off_board(&self) -> Option<ChannelName> {
        self.channels().first().copied()
    }

    /// Whether the model says how the bias follows the temperature.
    pub fn covers_temperature(&self) -> bool {
        self.terms.iter().any(|term| {
            let of_channel = term.channel().is_some_and(|channel| channel.as_str() == channel::TEMPERATURE);
            of_channel || matches!(term, Term::Temperature { .. } | Term::TemperatureRate { .. })
        })
    }

    /// Whether base motion is taken out row by row, and then how the accelerometers feel it.
    pub fn base_motion(&self) -> Option<Sensing> {
        self.terms.iter().find_map(|term| match term {
            &Term::BaseMotion { velocity, lag_s } => Some(Sensing { velocity, lag_s }),
            _ => None,
        })
    }

    /// The line that every fix has to estimate, if there is one.
    pub fn free_line(&self) -> Option<FreeLine> {
        self.terms.iter().find_map(|term| match *term {
            Term::FreeLine { period_s, amplitude_deg_h } => Some(FreeLine { period_s, amplitude_deg_h }),
            _ => None,
        })
    }

    /// All finite and in range; the scale factor within 10 % of one; not too many channels.
    pub fn validate(&self) -> Result<(), Invalid> {
        if !(-0.1..=0.1).contains(&self.scale_error) {
            return Err(Invalid { field: "model.scale_error", value: self.scale_error, allowed: "-0.1 to 0.1" });
        }
        if !self.bias_deg_h.is_finite() {
            return Err(Invalid { field: "model.bias_deg_h", value: self.bias_deg_h, allowed: "a finite number" });
        }
        let channels = self.channels();
        for term in &self.terms {
            term.validate()?;
            if term.channel().is_some_and(|name| !name.is_on_board() && !channels.contains(&name)) {
                let value = (channels.len() + 1) as f64;
                return Err(Invalid { field: "model.terms", value, allowed: "at most 8 channels" });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;

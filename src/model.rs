//! The error model: what a calibration knows of the gyro, taken out of every increment.
//!
//! raw rate = (1 + scale error) · true rate + bias + Σ terms, all rates in °/h.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::settings::Invalid;

/// Most terms that a model can have.
pub const MAX_TERMS: usize = 16;

/// A calibration: immutable input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ErrorModel {
    /// Scale factor error, dimensionless: raw rate = (1 + this) · true rate + ….
    pub scale_error: f64,
    /// Bias, °/h.
    pub bias_deg_h: f64,
    /// Effects beyond bias and scale.
    pub terms: Vec<Term, MAX_TERMS>,
}

/// An effect that adds to the raw rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// linear · (T − reference) + quadratic · (T − reference)², °/h.
    Temperature { reference_c: f64, linear_deg_h_per_k: f64, quadratic_deg_h_per_k2: f64 },
    /// Proportional to dT/dt (Shupe 1980), °/h per K/s.
    TemperatureRate { deg_h_per_k_per_s: f64 },
    /// Scale factor error proportional to T − reference, 1/K.
    ScaleTemperature { reference_c: f64, per_k: f64 },
}

impl Default for ErrorModel {
    fn default() -> Self {
        Self { scale_error: 0.0, bias_deg_h: 0.0, terms: Vec::new() }
    }
}

impl ErrorModel {
    pub fn validate(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

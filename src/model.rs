//! The error model: what a calibration knows of the gyro, taken out of every increment.
//!
//! raw rate = (1 + scale error) · true rate + bias + Σ terms, all rates in °/h.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::settings::Invalid;

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

/// An effect that adds to the raw rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Term {
    /// linear · (T − reference) + quadratic · (T − reference)², °/h.
    Temperature { reference_c: f64, linear_deg_h_per_k: f64, quadratic_deg_h_per_k2: f64 },
    /// Proportional to dT/dt, °/h per K/s (Shupe, Applied Optics 19, 1980, p. 654).
    TemperatureRate { deg_h_per_k_per_s: f64 },
    /// Scale factor error proportional to T − reference, 1/K.
    ScaleTemperature { reference_c: f64, per_k: f64 },
}

/// What the terms depend on, as the board measures it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Gyro temperature, °C.
    pub temp_c: Option<f64>,
    /// Its rate of change, K/s.
    pub temp_rate_k_s: Option<f64>,
}

/// The model evaluated under [`Conditions`]: what turns a raw rate into a true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    bias_deg_h: f64,
    scale: f64,
}

impl Correction {
    /// True angle increment, arcsec, of a raw one over `seconds`.
    pub fn apply(&self, increment_arcsec: f64, seconds: f64) -> f64 {
        (increment_arcsec - self.bias_deg_h * seconds) / self.scale
    }
}

impl Term {
    /// Whether the term's channel is there; a term without its channel cannot be evaluated.
    fn channel(&self, conditions: &Conditions) -> bool {
        match self {
            Self::Temperature { .. } | Self::ScaleTemperature { .. } => conditions.temp_c.is_some(),
            Self::TemperatureRate { .. } => conditions.temp_rate_k_s.is_some(),
        }
    }
}

impl ErrorModel {
    /// The correction under `conditions`. A term whose channel is absent contributes nothing; ask
    /// [`Self::is_covered_by`] first.
    pub fn correction(&self, conditions: &Conditions) -> Correction {
        let mut correction = Correction { bias_deg_h: self.bias_deg_h, scale: 1.0 + self.scale_error };
        for term in &self.terms {
            match (*term, conditions.temp_c, conditions.temp_rate_k_s) {
                (Term::Temperature { reference_c, linear_deg_h_per_k, quadratic_deg_h_per_k2 }, Some(temp_c), _) => {
                    let above_k = temp_c - reference_c;
                    correction.bias_deg_h += (linear_deg_h_per_k + quadratic_deg_h_per_k2 * above_k) * above_k;
                }
                (Term::TemperatureRate { deg_h_per_k_per_s }, _, Some(rate_k_s)) => {
                    correction.bias_deg_h += deg_h_per_k_per_s * rate_k_s;
                }
                (Term::ScaleTemperature { reference_c, per_k }, Some(temp_c), _) => {
                    correction.scale += per_k * (temp_c - reference_c);
                }
                _ => {}
            }
        }
        correction
    }

    /// Whether every term has the channel that it needs.
    pub fn is_covered_by(&self, conditions: &Conditions) -> bool {
        self.terms.iter().all(|term| term.channel(conditions))
    }

    /// Whether the model says how the bias follows the temperature.
    pub fn covers_temperature(&self) -> bool {
        self.terms.iter().any(|term| matches!(term, Term::Temperature { .. } | Term::TemperatureRate { .. }))
    }

    /// All finite; the scale factor within 10 % of one.
    pub fn validate(&self) -> Result<(), Invalid> {
        let finite = |field, value: f64| {
            if value.is_finite() { Ok(()) } else { Err(Invalid { field, value, allowed: "a finite number" }) }
        };
        if !(-0.1..=0.1).contains(&self.scale_error) {
            return Err(Invalid { field: "model.scale_error", value: self.scale_error, allowed: "-0.1 to 0.1" });
        }
        finite("model.bias_deg_h", self.bias_deg_h)?;
        for term in &self.terms {
            match *term {
                Term::Temperature { reference_c, linear_deg_h_per_k, quadratic_deg_h_per_k2 } => {
                    finite("model.terms.temperature.reference_c", reference_c)?;
                    finite("model.terms.temperature.linear_deg_h_per_k", linear_deg_h_per_k)?;
                    finite("model.terms.temperature.quadratic_deg_h_per_k2", quadratic_deg_h_per_k2)?;
                }
                Term::TemperatureRate { deg_h_per_k_per_s } => {
                    finite("model.terms.temperature-rate.deg_h_per_k_per_s", deg_h_per_k_per_s)?;
                }
                Term::ScaleTemperature { reference_c, per_k } => {
                    finite("model.terms.scale-temperature.reference_c", reference_c)?;
                    finite("model.terms.scale-temperature.per_k", per_k)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_term_by_hand() {
        let model = ErrorModel {
            scale_error: 0.01,
            bias_deg_h: 0.5,
            terms: Vec::from_slice(&[
                Term::Temperature { reference_c: 20.0, linear_deg_h_per_k: 0.1, quadratic_deg_h_per_k2: 0.01 },
                Term::TemperatureRate { deg_h_per_k_per_s: 9.0 },
                Term::ScaleTemperature { reference_c: 20.0, per_k: 0.001 },
            ])
            .unwrap(),
        };
        let conditions = Conditions { temp_c: Some(25.0), temp_rate_k_s: Some(0.01) };
        // Bias 0.5 + 5 · 0.1 + 25 · 0.01 + 9 · 0.01 = 1.34 °/h; scale 1 + 0.01 + 0.005. A true 10 °/h over 2 s is
        // 20 arcsec, read as 20 · 1.015 + 2 · 1.34 = 22.98 arcsec.
        assert!((model.correction(&conditions).apply(22.98, 2.0) - 20.0).abs() < 1e-12);
        assert!(model.is_covered_by(&conditions));
        assert!(!model.is_covered_by(&Conditions { temp_rate_k_s: None, ..conditions }));
        assert!(model.validate().is_ok());
    }

    #[test]
    fn nonsense_is_named() {
        let model = ErrorModel { scale_error: 0.5, ..Default::default() };
        assert_eq!(model.validate().unwrap_err().field, "model.scale_error");
        let model = ErrorModel { bias_deg_h: f64::NAN, ..Default::default() };
        assert_eq!(model.validate().unwrap_err().field, "model.bias_deg_h");
    }
}

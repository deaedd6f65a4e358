//! An additive term: a basis, or a product of two, with coefficients.

use core::fmt;

use heapless::Vec;
use quantities::limits::{Invalid, finite};
use serde::{Deserialize, Serialize};

use super::basis::{Basis, Missing, Now};
use super::channel::ChannelName;
use crate::bounded::bounded;

/// Most coefficients of one term: a surface of two channels on a grid of four by five.
pub const MAX_TERM_COEFFICIENTS: usize = 20;

/// Numbers of a term, °/h per unit of the functions (or 1 per that unit, where the term scales).
pub type Coefficients = Vec<f32, MAX_TERM_COEFFICIENTS>;

/// Σ coefficient · function adds to the raw rate, °/h.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    pub coefficients: Coefficients,
    /// The sum multiplies the true rate instead: an error of the scale factor.
    #[serde(default)]
    pub scales: bool,
    pub basis: Basis,
    /// Every function is multiplied with every one of these: the coefficients of the first function with all of these come
    /// first.
    #[serde(default)]
    pub times: Option<Basis>,
}

/// What the bases of a term remember.
pub type Memory = [Option<f64>; 2];

impl Term {
    /// A term whose coefficients are not known yet: all 0.
    pub fn new(basis: Basis) -> Self {
        Self { coefficients: Vec::new(), scales: false, basis, times: None }.zeroed()
    }

    /// The same as an error of the scale factor.
    pub fn scaling(basis: Basis) -> Self {
        Self { scales: true, ..Self::new(basis) }
    }

    /// A product of two bases.
    pub fn product(basis: Basis, times: Basis) -> Self {
        Self { times: Some(times), ..Self::new(basis) }.zeroed()
    }

    fn zeroed(mut self) -> Self {
        self.coefficients = bounded(core::iter::repeat_n(0.0, self.count()));
        self
    }

    /// The same with these coefficients; those beyond a term's room are dropped.
    pub fn with_coefficients(mut self, numbers: &[f64]) -> Self {
        self.coefficients = bounded(numbers.iter().map(|&number| number as f32));
        self
    }

    /// How many coefficients there must be.
    pub fn count(&self) -> usize {
        self.basis.count() * self.times.as_ref().map_or(1, Basis::count)
    }

    pub fn bases(&self) -> impl Iterator<Item = &Basis> {
        core::iter::once(&self.basis).chain(&self.times)
    }

    /// Calls `each` with the number and the value of every function, for a true rate of 1 °/h where the term scales.
    pub fn functions(
        &self,
        now: &Now<'_>,
        memory: &mut Memory,
        each: &mut dyn FnMut(usize, f64),
    ) -> Result<(), Missing> {
        let [own, other] = memory;
        // Both are asked, so that both remember.
        let values = self.basis.values(now, own);
        let times = self.times.as_ref().map_or_else(|| Ok(bounded([1.0])), |times| times.values(now, other));
        let (values, times) = (values?, times?);
        let products = values.iter().flat_map(|value| times.iter().map(move |times| value * times));
        products.enumerate().for_each(|(place, value)| each(place, value));
        Ok(())
    }

    /// Names of the channels that it follows.
    pub fn channels(&self) -> impl Iterator<Item = &ChannelName> {
        self.bases().filter_map(Basis::channel)
    }

    pub fn is_rate(&self) -> bool {
        self.bases().any(Basis::is_rate)
    }

    /// The parameter that the functions are not linear in: the first basis', or the second's.
    pub fn constant(&self) -> Option<(&'static str, f64)> {
        self.bases().find_map(Basis::constant)
    }

    /// The same with another value of that parameter.
    pub fn with_constant(mut self, value: f64) -> Self {
        if self.basis.constant().is_some() {
            self.basis = self.basis.with_constant(value);
        } else {
            self.times = self.times.map(|times| times.with_constant(value));
        }
        self
    }

    /// Every number finite, time constants and widths positive, lags and orders in their range, and as many coefficients as
    /// functions.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.bases().try_for_each(Basis::validate)?;
        if self.coefficients.len() != self.count() {
            let (field, value) = ("model.terms.coefficients (number)", self.coefficients.len() as f64);
            return Err(Invalid::new(field, value, "as many as the term has functions, at most 20"));
        }
        self.coefficients.iter().try_for_each(|&number| finite("model.terms.coefficients", &[number.into()]))
    }
}

/// The stable name: lower-case words with hyphens.
impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.scales {
            f.write_str("scale-")?;
        }
        self.basis.fmt(f)?;
        match &self.times {
            Some(times) => write!(f, "-times-{times}"),
            None => Ok(()),
        }
    }
}

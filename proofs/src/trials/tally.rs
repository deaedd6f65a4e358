//! What many errors of one parameter say together.

use serde::Serialize;

/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.959_964;

/// Collects the errors of one parameter.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    count: f64,
    normalized: f64,
    squares: f64,
    covered: f64,
    reference_squares: f64,
    ratio_squares: f64,
}

/// Summary of one parameter.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    pub name: String,
    /// Mean of error/sigma: 0 if unbiased …
    pub mean_in_sigmas: f64,
    /// … within this, half of a 95 % interval.
    pub mean_confidence_95: f64,
    /// Share of errors within ±1.96 of their sigmas.
    pub coverage: f64,
    /// Half width of its 95 % interval (binomial).
    pub coverage_confidence_95: f64,
    /// Root mean square of the errors.
    pub rms: f64,
    /// The same of what they are compared with: other errors of the same trial, or a bound.
    pub reference_rms: f64,
    /// Root mean square of error/bound.
    pub ratio: f64,
}

impl Tally {
    /// An error with the sigma that was given for it, and another error of the same parameter, or a bound.
    pub fn push(&mut self, error: f64, sigma: f64, reference: f64) {
        self.count += 1.0;
        self.normalized += error / sigma;
        self.squares += error * error;
        self.covered += f64::from(u8::from(error.abs() <= Z_95 * sigma));
        self.reference_squares += reference * reference;
        self.ratio_squares += (error / reference).powi(2);
    }

    /// Its summary.
    pub fn summary(&self, name: String) -> Parameter {
        let coverage = self.covered / self.count;
        Parameter {
            name,
            mean_in_sigmas: self.normalized / self.count,
            mean_confidence_95: Z_95 / self.count.sqrt(),
            coverage,
            coverage_confidence_95: Z_95 * (coverage * (1.0 - coverage) / self.count).sqrt(),
            rms: (self.squares / self.count).sqrt(),
            reference_rms: (self.reference_squares / self.count).sqrt(),
            ratio: (self.ratio_squares / self.count).sqrt(),
        }
    }
}

impl Parameter {
    /// Whether the mean error is within what chance gives in one of many parameters (four standard deviations).
    pub fn is_unbiased(&self) -> bool {
        self.mean_in_sigmas.abs() <= 4.0 / Z_95 * self.mean_confidence_95
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_by_hand() {
        let mut tally = Tally::default();
        for (error, sigma) in [(3.0, 1.0), (-3.0, 2.0), (1.0, 1.0), (5.0, 3.0)] {
            tally.push(error, sigma, 2.0);
        }
        let summary = tally.summary("x".into());
        assert_eq!(summary.rms, 11f64.sqrt());
        assert_eq!((summary.reference_rms, summary.coverage), (2.0, 0.75));
        assert!((summary.ratio - (11.0f64 / 4.0).sqrt()).abs() < 1e-12);
        assert!((summary.mean_in_sigmas - (3.0 - 1.5 + 1.0 + 5.0 / 3.0) / 4.0).abs() < 1e-12);
        assert!(summary.is_unbiased());
    }
}

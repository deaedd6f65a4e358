//! Why attitudes give no calibration.

use super::coverage::{Direction, LEAST_COVERAGE};

/// Fewest attitudes: as many as there are parameters.
pub const LEAST_ATTITUDES: usize = 9;
/// Largest ratio of half axes that the scale factors of one triad can have.
pub(super) const MOST_ELONGATED: f64 = 2.0;
/// Largest rms of |f|/G − 1 that is left on an ellipsoid.
pub(super) const MOST_RESIDUAL: f64 = 0.02;

/// Why attitudes give no calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    TooFew {
        attitudes: usize,
    },
    /// These directions (of gravity's reaction, so: which way is up) are missing, the worst first.
    Coverage {
        coverage: f64,
        missing: [Option<Direction>; 4],
    },
    /// The points lie on something else.
    NoEllipsoid,
    /// The ratio of the half axes is not that of a triad.
    Elongated {
        ratio: f64,
    },
    /// What is left of |f|/G − 1, rms.
    Residual {
        rms: f64,
    },
    /// The readings are too noisy: |f|/G is known to this only.
    TooNoisy {
        sigma: f64,
    },
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFew { attitudes } => {
                write!(f, "{attitudes} attitudes to learn from; at least {LEAST_ATTITUDES} are needed, 23 are good")
            }
            Self::Coverage { coverage, missing } => {
                write!(
                    f,
                    "the attitudes do not cover the sphere: coverage {coverage:.3}, at least {LEAST_COVERAGE:.3} is needed; \
                     missing, with this way up:"
                )?;
                for direction in missing.iter().flatten() {
                    write!(f, " {direction}")?;
                }
                Ok(())
            }
            Self::NoEllipsoid => write!(f, "the readings do not lie on an ellipsoid: no ellipsoid fits them"),
            Self::Elongated { ratio } => write!(
                f,
                "the readings are not those of a triad: the half axes of their ellipsoid differ by a factor of {ratio:.2} \
                 (allowed is {MOST_ELONGATED})"
            ),
            Self::Residual { rms } => write!(
                f,
                "the readings do not lie on an ellipsoid: the norm is off by {:.2} % rms after the fit (allowed is {} %)",
                100.0 * rms,
                100.0 * MOST_RESIDUAL
            ),
            Self::TooNoisy { sigma } => {
                write!(f, "the readings are too noisy: the norm would be known to {:.2} % only", 100.0 * sigma)
            }
        }
    }
}

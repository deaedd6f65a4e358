//! A run as what happens in it by itself is sought: its samples white, what is known of its own unknowns beside them.

use nalgebra::{DMatrix, DVector};

use super::dictionary::Dictionary;
use super::sheet::Sheet;
use super::tie::Tie;

/// What a course is sought in: a run, white.
pub struct Seen<'a> {
    pub sheet: &'a Sheet<'a>,
    /// Roots of the samples' weights.
    pub roots: DVector<f64>,
    /// Their white noise.
    pub white: DMatrix<f64>,
    /// Rows of the run's own unknowns, and what a surveyed heading says of them.
    pub design: &'a DMatrix<f64>,
    pub ties: Vec<Tie>,
    pub dictionary: &'a Dictionary,
}

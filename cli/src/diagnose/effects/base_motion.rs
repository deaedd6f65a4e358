//! Motion of the base, as the accelerometers show it.

use super::Candidate;
use crate::diagnose::candidate::Part;

/// Windows of the slopes, seconds.
const WINDOWS_S: [f64; 4] = [2.0, 8.0, 30.0, 80.0];

pub fn candidates(list: &mut Vec<Candidate>) {
    list.push(Candidate::new("base-motion", "base-motion", Part::BaseMotion, WINDOWS_S.to_vec()));
}

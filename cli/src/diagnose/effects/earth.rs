//! What is fixed to the Earth: the horizontal rate itself by a wrong scale factor, and fields that look like it.

use super::Candidate;
use crate::diagnose::candidate::Part;

pub fn candidates(list: &mut Vec<Candidate>) {
    list.push(Candidate::new("scale-factor", "scale", Part::ScaleFactor, vec![]));
    for north in [false, true] {
        list.push(Candidate::new("earth-field", "azimuth", Part::EarthField { north }, vec![]));
    }
}

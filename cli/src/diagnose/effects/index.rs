//! What the encoder reads wrongly.

use super::Candidate;
use crate::diagnose::candidate::Part;

pub fn candidates(list: &mut Vec<Candidate>) {
    list.push(Candidate::new("index-offset", "index", Part::IndexOffset, vec![]));
    list.push(Candidate::new("index-eccentricity", "index", Part::IndexEccentricity, vec![]));
}

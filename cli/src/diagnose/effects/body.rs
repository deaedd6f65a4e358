//! What is fixed to the instrument's body: harmonics of the index angle, and a bias of its level sensors.

use north_finder::effects::basis::harmonic::BodyHarmonic;
use north_finder::effects::{Basis, Term};

use super::Candidate;
use crate::diagnose::candidate::Part;

pub fn harmonics(list: &mut Vec<Candidate>) {
    for order in 1..=6 {
        list.push(Candidate::term(Term::new(Basis::BodyHarmonic(BodyHarmonic { order })), vec![]));
    }
}

pub fn level_bias(list: &mut Vec<Candidate>, up_deg_h: f64) {
    list.push(Candidate::new("level-bias", "bias", Part::LevelBias { up_deg_h }, vec![]));
}

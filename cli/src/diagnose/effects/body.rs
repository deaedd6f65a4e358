//! What is fixed to the instrument's body: harmonics of the index angle, a bias of its level sensors, gravity on the gyro.

use north_finder::effects::basis::harmonic::BodyHarmonic;
use north_finder::effects::{Basis, Term};

use super::Candidate;
use crate::diagnose::candidate::Part;

pub fn harmonics(list: &mut Vec<Candidate>) {
    for order in 1..=6 {
        list.push(Candidate::term(Term::new(Basis::BodyHarmonic(BodyHarmonic { order })), vec![]));
    }
}

pub fn tilted(list: &mut Vec<Candidate>, up_deg_h: f64) {
    list.push(Candidate::new("gravity-sensitivity", "bias", Part::AxisTilt, vec![]));
    list.push(Candidate::new("level-bias", "bias", Part::LevelBias { up_deg_h }, vec![]));
}

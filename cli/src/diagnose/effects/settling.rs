//! What dies away after a move of the index.

use north_finder::effects::basis::settling::{Settling, Size};
use north_finder::effects::{Basis, Term};

use super::{Candidate, Scales, geometric};

pub fn candidates(list: &mut Vec<Candidate>, scales: &Scales) {
    let sizes = [Size::Constant, Size::Direction, Size::Travel, Size::SignedTravel, Size::Position];
    for (by, first_dwell) in sizes.map(|by| (by, false)).into_iter().chain([(Size::Constant, true)]) {
        let basis = Basis::Settling(Settling { tau_s: 1.0, by, first_dwell });
        list.push(Candidate::term(Term::new(basis), geometric(2.0 * scales.step_s, scales.longest_s / 3.0, 8)));
    }
}

//! Which attitudes are learned from and which are only judged.

use super::LEAST_ATTITUDES;
use super::coverage::Coverage;
use super::{Entry, Role, nominal};

/// Of this many attitudes in a row one is only judged.
const ONE_IN: usize = 4;

/// Gives each entry its role. Of every four, in the order in which they were taken, that one is only judged which the
/// others can best do without for their cover of the sphere; its readings have no part in the choice but for their
/// direction. At least nine are left to learn from.
#[inline(never)]
pub fn split(entries: &mut [Entry], gravity: f64) {
    let means = entries.iter().map(|entry| entry.attitude.mean);
    let nominal = nominal(means.clone(), gravity);
    let direction = |raw: [f64; 3]| {
        let norm = nominal.norm(raw);
        nominal.apply(raw).map(|part| part / norm)
    };
    let coverage = Coverage::of(means.map(direction));
    let mut may_judge = entries.len().saturating_sub(LEAST_ATTITUDES);
    for four in entries.chunks_mut(ONE_IN) {
        four.iter_mut().for_each(|entry| entry.role = Role::Fit);
        if four.len() < ONE_IN || may_judge == 0 {
            continue;
        }
        let known = |entry: &Entry| coverage.towards(direction(entry.attitude.mean));
        if let Some(spared) = four.iter_mut().max_by(|a, b| known(a).total_cmp(&known(b))) {
            spared.role = Role::Check;
            may_judge -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ellipsoid::attitude::Attitude;
    use crate::ellipsoid::coverage::Direction;
    use std::vec::Vec;

    fn entries(count: usize) -> Vec<Entry> {
        let entry = |direction: Direction| Entry {
            attitude: Attitude { mean: direction.unit(), readings: 10, ..Attitude::default() },
            role: Role::Invalid,
        };
        Direction::all().map(entry).take(count).collect()
    }

    fn judged(entries: &[Entry]) -> usize {
        entries.iter().filter(|entry| entry.role == Role::Check).count()
    }

    #[test]
    fn a_quarter_is_held_out_and_nine_are_left() {
        for (count, expected) in [(0, 0), (9, 0), (10, 1), (11, 2), (12, 3), (16, 4), (23, 5), (26, 6)] {
            let mut entries = entries(count);
            split(&mut entries, 1.0);
            assert_eq!(judged(&entries), expected, "{count}");
            assert!(entries.iter().all(|entry| entry.role != Role::Invalid));
        }
    }

    #[test]
    fn the_only_one_of_its_direction_is_learned_from() {
        let mut entries = entries(26);
        for lonely in 0..4 {
            // Four of +z, one of them replaced by the only −z.
            let mut four = [[0.0, 0.0, 1.0]; 4];
            four[lonely] = [0.0, 0.0, -1.0];
            let others = Direction::all().map(Direction::unit).filter(|[_, _, z]| *z > -0.1);
            for (entry, mean) in entries.iter_mut().zip(four.into_iter().chain(others)) {
                entry.attitude.mean = mean;
            }
            entries.truncate(21);
            split(&mut entries, 1.0);
            assert_eq!(entries[lonely].role, Role::Fit, "{lonely}");
            assert_eq!(judged(&entries[..4]), 1);
        }
    }
}

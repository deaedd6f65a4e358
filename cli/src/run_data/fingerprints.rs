//! Marks of a recording's increments, by which two runs that hold the same stretch are known, whatever their times say.

use std::collections::{HashMap, VecDeque};

/// Increments that make a mark.
const WINDOW: usize = 32;
/// One window in so many leaves a mark, by its own value: in both runs the same ones.
const ONE_IN: u64 = 8;
/// A window with less information than this, bits by the frequencies of its values, may repeat by chance: two runs of 10⁶ rows have 10¹² pairs, 40 bits.
const LEAST_BITS: f64 = 80.0;
/// So many marks that both have are a common stretch of some hundred rows.
const LEAST_COMMON: usize = 4;
/// An odd number without a pattern (2⁶⁴ over the golden ratio).
const FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;

/// The marks of one run.
#[derive(Clone, Debug, Default)]
pub struct Fingerprints {
    recent: VecDeque<u64>,
    marks: Vec<u64>,
}

impl Fingerprints {
    pub fn push(&mut self, increment: f64) {
        self.recent.push_back(increment.to_bits());
        if self.recent.len() > WINDOW {
            self.recent.pop_front();
        }
        if self.recent.len() < WINDOW {
            return;
        }
        let mark = self.recent.iter().fold(0_u64, |hash, bits| (hash.rotate_left(7) ^ bits).wrapping_mul(FACTOR));
        if (mark >> 32).is_multiple_of(ONE_IN) && self.bits() >= LEAST_BITS {
            self.marks.push(mark);
        }
    }

    /// What the window says, bits.
    fn bits(&self) -> f64 {
        let mut counts: HashMap<u64, f64> = HashMap::new();
        self.recent.iter().for_each(|bits| *counts.entry(*bits).or_default() += 1.0);
        let length = self.recent.len() as f64;
        counts.values().map(|count| count * (length / count).log2()).sum()
    }

    /// Whether both hold one stretch.
    pub fn overlap(&self, other: &Self) -> bool {
        let (mut one, mut two) = (self.marks.clone(), other.marks.clone());
        one.sort_unstable();
        one.dedup();
        two.sort_unstable();
        one.iter().filter(|mark| two.binary_search(mark).is_ok()).count() >= LEAST_COMMON
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(increments: impl Iterator<Item = f64>) -> Fingerprints {
        let mut marks = Fingerprints::default();
        increments.for_each(|increment| marks.push(increment));
        marks
    }

    /// Whole numbers from 0 to `levels` without a pattern.
    fn counts(seed: u64, levels: u64) -> impl Iterator<Item = f64> {
        // The multiples of an odd number repeat their neighbours' order; mixed once more they do not.
        let mixed = |i: u64| {
            let once = (i ^ i >> 29).wrapping_mul(FACTOR);
            (once ^ once >> 32).wrapping_mul(FACTOR) >> 20
        };
        (1..5000_u64).map(move |i| (mixed((i + seed).wrapping_mul(FACTOR)) % levels) as f64)
    }

    #[test]
    fn a_common_stretch_is_seen_and_chance_is_not() {
        let (one, other) = (of(counts(0, 1000)), of(counts(100_000, 1000)));
        assert!(!one.overlap(&other));
        assert!(one.overlap(&of(counts(4700, 1000))), "300 rows");
        // Increments of a few counts, and of a gyro that stands still between them.
        assert!(of(counts(0, 8)).overlap(&of(counts(4000, 8))));
        assert!(!of(counts(0, 8)).overlap(&of(counts(100_000, 8))));
        let dead = || of((0..5000).map(|i| f64::from(u8::from(i % 50 == 0))));
        assert!(!dead().overlap(&dead()));
    }
}

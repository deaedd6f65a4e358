//! Room for numbers where the rows of a dwell are while one is under way.
//!
//! An azimuth is reckoned between dwells, and its largest matrix is as large as half of the rows: it lies where they were.

use core::cell::Cell;

/// Doubles by their number, from 0, all of them 0 at first.
#[derive(Clone, Copy)]
pub struct Room<'a>(&'a [Cell<u64>]);

impl<'a> Room<'a> {
    /// In words that hold the bits of zeros.
    pub fn new(words: &'a mut [u64]) -> Self {
        Self(Cell::from_mut(words).as_slice_of_cells())
    }

    /// One of the numbers; 0 beyond the last.
    pub fn get(self, place: usize) -> f64 {
        self.0.get(place).map_or(0.0, |word| f64::from_bits(word.get()))
    }

    /// Puts a number there; `None`: there is no such place.
    pub fn set(self, place: usize, number: f64) -> Option<()> {
        self.0.get(place).map(|word| word.set(number.to_bits()))
    }

    /// Several numbers from `place` on.
    pub fn get_some<const N: usize>(self, place: usize) -> [f64; N] {
        core::array::from_fn(|i| self.get(place + i))
    }

    /// Puts several numbers from `place` on; `None`: there is no room for all.
    pub fn set_some<const N: usize>(self, place: usize, numbers: [f64; N]) -> Option<()> {
        numbers.into_iter().zip(place..).try_for_each(|(number, place)| self.set(place, number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_there_is_there() {
        let mut words = [0; 5];
        let room = Room::new(&mut words);
        assert_eq!(room.set_some(1, [-1.5, f64::INFINITY]), Some(()));
        assert_eq!(room.get_some(0), [0.0, -1.5, f64::INFINITY, 0.0, 0.0, 0.0]);
        assert_eq!((room.set(4, 1.0), room.set(5, 1.0), room.set_some(4, [1.0; 2])), (Some(()), None, None));
    }
}

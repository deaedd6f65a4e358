//! A curve in one variable: a natural cubic spline, straight beyond its outer knots.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Most knots.
pub const MAX_KNOTS: usize = 7;

/// Up to seven numbers.
#[derive(Clone, Copy, Default, PartialEq)]
pub struct Numbers {
    values: [f64; MAX_KNOTS],
    length: u8,
}

impl Numbers {
    /// `None` where they are too many.
    pub fn new(numbers: &[f64]) -> Option<Self> {
        let mut values = [0.0; MAX_KNOTS];
        values.get_mut(..numbers.len())?.copy_from_slice(numbers);
        Some(Self { values, length: numbers.len() as u8 })
    }

    pub fn as_slice(&self) -> &[f64] {
        self.values.get(..self.length.into()).unwrap_or_default()
    }
}

impl fmt::Debug for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.as_slice().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let numbers = Vec::<f64, MAX_KNOTS>::deserialize(deserializer)?;
        Self::new(&numbers).ok_or_else(|| de::Error::custom("at most 7 numbers"))
    }
}

/// Number `j` of the functions that natural cubic splines with these knots (three or more, rising) are made of, one fewer
/// than the knots: the first is `x` above the first knot, the others vanish below their own knot and have the unit of `x`
/// too (Stone and Koo, Proc. Stat. Comp. ASA, 1985, p. 45).
pub fn basis(knots: &[f64], j: usize, x: f64) -> f64 {
    let &[first, .., before, last] = knots else { return 0.0 };
    let Some(own) = j.checked_sub(1) else { return x - first };
    let Some(&knot) = knots.get(own) else { return 0.0 };
    let cube = |from: f64| {
        let above = (x - from).max(0.0);
        above * above * above
    };
    let bent =
        cube(knot) - cube(before) * (last - knot) / (last - before) + cube(last) * (before - knot) / (last - before);
    bent / ((last - first) * (last - first))
}

/// The curve with these coefficients of its functions.
pub fn at(knots: &[f64], coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().enumerate().map(|(j, coefficient)| coefficient * basis(knots, j, x)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOTS: [f64; 4] = [0.0, 1.0, 2.0, 4.0];

    #[test]
    fn by_hand() {
        assert_eq!(basis(&KNOTS, 0, 3.0), 3.0);
        // Knot 0: 3³ − 1³ · (4 − 0)/2 + 0, over 4².
        assert_eq!(basis(&KNOTS, 1, 3.0), 25.0 / 16.0);
        // Knot 1: 2³ − 1³ · (4 − 1)/2 + 0, over 4².
        assert_eq!(basis(&KNOTS, 2, 3.0), 6.5 / 16.0);
        assert_eq!(at(&KNOTS, &[1.0, 16.0, -16.0], 3.0), 3.0 + 25.0 - 6.5);
    }

    #[test]
    fn straight_beyond_the_knots() {
        for j in 0..3 {
            for x in [-5.0, 7.0, 50.0] {
                let bend = basis(&KNOTS, j, x - 1.0) - 2.0 * basis(&KNOTS, j, x) + basis(&KNOTS, j, x + 1.0);
                assert!(bend.abs() < 1e-9, "{j} {x} {bend}");
            }
        }
    }

    #[test]
    fn too_many_numbers_are_refused() {
        assert!(Numbers::new(&[0.0; 8]).is_none());
        assert!(serde_json::from_str::<Numbers>("[0, 1, 2, 3, 4, 5, 6, 7]").is_err());
        let three: Numbers = serde_json::from_str("[0.0, 1.5, 2.0]").unwrap();
        assert_eq!(three.as_slice(), [0.0, 1.5, 2.0]);
    }
}

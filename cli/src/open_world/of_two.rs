//! Functions of two channels with constants that the search tunes.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::columns::from_columns;
use super::recording::Samples;

/// Directions of a combination of two channels in half a turn, those of one channel among them.
const DIRECTIONS: usize = 8;
/// Places of a crease, half ranges.
const PLACES: [f64; 5] = [-0.6, -0.3, 0.0, 0.3, 0.6];
/// Where a divisor would be nothing, half ranges from its middle; the least that it counts as.
const POLES: [f64; 8] = [-2.6, -1.9, -1.5, -1.25, 1.25, 1.5, 1.9, 2.6];
const LEAST_DIVISOR: f64 = 0.15;
/// Steps for a share of one: of a direction, radians, of a place and of a pole, half ranges.
const OF_DIRECTION: f64 = 5.0;
const OF_PLACE: f64 = 2.0;
const OF_POLE: f64 = 5.0;

/// A function of two channels, which are counted in half ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OfTwo {
    /// Both, and what a combination of them in this direction (radians from the first to the second) has above a place: what the greater
    /// of the two makes.
    Crease { toward_rad: f64, at: f64 },
    /// One and the first by the second, which is nothing at this place.
    Quotient(f64),
}

/// Directions from the first of two channels to the second, in which both have a share.
pub fn directions_rad() -> impl Iterator<Item = f64> {
    (1..DIRECTIONS).filter(|number| 2 * number != DIRECTIONS).map(|number| PI * number as f64 / DIRECTIONS as f64)
}

impl OfTwo {
    /// All creases that are begun with: the channels' order makes no difference.
    pub fn creases() -> Vec<Self> {
        directions_rad().flat_map(|toward_rad| PLACES.map(|at| Self::Crease { toward_rad, at })).collect()
    }

    /// All quotients that are begun with, of the first by the second.
    pub fn quotients() -> Vec<Self> {
        POLES.map(Self::Quotient).to_vec()
    }

    /// How many constants are tuned.
    pub fn constants(self) -> usize {
        match self {
            Self::Crease { .. } => 2,
            Self::Quotient(_) => 1,
        }
    }

    /// With one constant a little more or less.
    pub fn neighbours(self, share: f64) -> Vec<Self> {
        match self {
            Self::Crease { toward_rad, at } => {
                let turned = [-share, share].map(|by| Self::Crease { toward_rad: toward_rad + OF_DIRECTION * by, at });
                let shifted = [-share, share].map(|by| Self::Crease { toward_rad, at: at + OF_PLACE * by });
                [turned, shifted].concat()
            }
            Self::Quotient(pole) => [-share, share].map(|by| Self::Quotient(pole + OF_POLE * by)).to_vec(),
        }
    }

    pub fn words(self, [first, second]: [&str; 2]) -> String {
        match self {
            Self::Crease { .. } => format!("greater or less of {first} and {second}"),
            Self::Quotient(_) => format!("quotient of {first} by {second}"),
        }
    }

    /// Its columns over samples, from the channels' values in half ranges by the second.
    pub fn columns(self, samples: &Samples, [first, second]: [&[f64]; 2]) -> DMatrix<f64> {
        let both = || first.iter().zip(second);
        let series: Vec<Vec<f64>> = match self {
            Self::Crease { toward_rad, at } => {
                let (sin, cos) = toward_rad.sin_cos();
                let above = both().map(|(a, b)| (cos * a + sin * b - at).max(0.0)).collect();
                vec![first.to_vec(), second.to_vec(), above]
            }
            Self::Quotient(pole) => {
                let one_by = |b: f64| 1.0 / ((pole - b) * pole.signum()).max(LEAST_DIVISOR);
                vec![second.iter().map(|&b| one_by(b)).collect(), both().map(|(a, &b)| a * one_by(b)).collect()]
            }
        };
        from_columns(samples.len(), series.into_iter().map(|values| samples.means(values)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::recording::Recording;
    use super::*;

    /// Columns over ten seconds, each a sample of its own.
    fn columns(of_two: OfTwo, first: &[f64; 10], second: &[f64; 10]) -> DMatrix<f64> {
        let mut recording =
            Recording { dwell: vec![0; 10], rate_deg_h: vec![0.0; 10], rotation: true, ..Recording::default() };
        for i in 0..10 {
            recording.t_s.push(i as f64 + 0.5);
            recording.interval_s.push(1.0);
            recording.enters.push(true);
            recording.moving.push(false);
        }
        let samples = Samples::new(&recording, 1.0, &recording.enters).unwrap();
        of_two.columns(&samples, [first, second])
    }

    const FIRST: [f64; 10] = [-1.0, -0.8, -0.5, -0.2, 0.0, 0.1, 0.4, 0.6, 0.9, 1.0];
    const SECOND: [f64; 10] = [0.3, -0.9, 0.5, -0.4, 0.2, 0.8, -0.6, 0.7, -1.0, 0.9];

    /// The greater of 2a + 0.3 and b is b and what 2a − b has above −0.3: in units of √5, the direction's length.
    #[test]
    fn a_crease_is_the_greater_of_two() {
        let root = 5f64.sqrt();
        let columns = columns(OfTwo::Crease { toward_rad: (-1f64).atan2(2.0), at: -0.3 / root }, &FIRST, &SECOND);
        for i in 0..10 {
            let found = columns[(i, 1)] + root * columns[(i, 2)];
            assert!((found - (2.0 * FIRST[i] + 0.3).max(SECOND[i])).abs() < 1e-12, "{i}: {found}");
        }
    }

    /// (3 + a)/(1.5 + b) is three of the first column and one of the second with the pole at −1.5; on the other side it is the same of −b.
    #[test]
    fn a_quotient_has_its_pole_outside_the_range() {
        let (below, above) =
            (columns(OfTwo::Quotient(-1.5), &FIRST, &SECOND), columns(OfTwo::Quotient(1.5), &FIRST, &SECOND));
        for i in 0..10 {
            let of = |columns: &DMatrix<f64>| 3.0 * columns[(i, 0)] + columns[(i, 1)];
            assert!((of(&below) - (3.0 + FIRST[i]) / (1.5 + SECOND[i])).abs() < 1e-12);
            assert!((of(&above) - (3.0 + FIRST[i]) / (1.5 - SECOND[i])).abs() < 1e-12);
        }
        // Near the pole the divisor stays positive.
        assert_eq!(columns(OfTwo::Quotient(-1.0), &FIRST, &SECOND)[(8, 0)], 1.0 / LEAST_DIVISOR);
    }

    #[test]
    fn neighbours_change_one_constant() {
        let crease = OfTwo::Crease { toward_rad: 1.0, at: 0.2 };
        let near = crease.neighbours(0.01);
        assert_eq!(near.len(), 2 * crease.constants());
        assert!(near.contains(&OfTwo::Crease { toward_rad: 1.05, at: 0.2 }));
        assert!(near.contains(&OfTwo::Crease { toward_rad: 1.0, at: 0.2 - 0.02 }));
        assert_eq!(OfTwo::Quotient(1.5).neighbours(0.1), [OfTwo::Quotient(1.0), OfTwo::Quotient(2.0)]);
    }
}

//! How well attitudes cover the sphere, and which directions are missing.
//!
//! The error of the norm in direction u is a sum of nine functions of u: three linear (biases) and six quadratic (scale
//! factors and non-orthogonality). A set of attitudes knows it in direction u with a variance proportional to
//! d(u) = a(u)ᵀ (Σ a aᵀ / n)⁻¹ a(u). For an even cover of the sphere d is 9 everywhere, and no set makes its greatest
//! value less (Kiefer and Wolfowitz, Canadian Journal of Mathematics 12, 1960, p. 363). So coverage = 9 / max d: 1 for an
//! even cover; 1/4 where the worst direction has twice the standard deviation; 0 where some direction is not known at all.

use serde::{Deserialize, Serialize};

/// Least coverage that gives a calibration: in the worst direction eight times the standard deviation of an even cover. A
/// hemisphere has less.
pub const LEAST_COVERAGE: f64 = 1.0 / 64.0;

/// Information that every combination of the functions has at least: far above what rounding leaves of none, and far below what one
/// attitude of a full set tells. Where nothing is known, coverage is 9 times as much by the square of the functions there.
const LEAST: f32 = 1e-5;

/// Functions of a direction.
const FUNCTIONS: usize = 9;
type Row = [f32; FUNCTIONS];

/// A direction along axes, edges or corners of the instrument's cube: signs of x, y, z, not all zero. It is the direction
/// that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Direction(pub [i8; 3]);

impl Direction {
    /// The six axes, the twelve edges and the eight corners.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        (-1..=1)
            .flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| Self([x, y, z]))))
            .filter(|direction| direction.0 != [0; 3])
    }

    /// As a unit vector.
    pub fn unit(self) -> [f64; 3] {
        let parts = self.0.map(f64::from);
        let norm = libm::sqrt(parts.iter().map(|part| part * part).sum());
        parts.map(|part| part / norm)
    }
}

impl core::fmt::Display for Direction {
    /// Such as `+x` or `+x-z`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (sign, name) in self.0.into_iter().zip(['x', 'y', 'z']).filter(|(sign, _)| *sign != 0) {
            write!(f, "{}{name}", if sign < 0 { '-' } else { '+' })?;
        }
        Ok(())
    }
}

/// The nine functions of a unit vector.
fn functions(unit: [f64; 3]) -> Row {
    let [x, y, z] = unit.map(|part| part as f32);
    [x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
}

/// How well a set of directions covers the sphere. In single precision: it is told to three digits, and a board looks around between
/// two samples of the gyro.
pub struct Coverage {
    /// Rows of the lower triangular L with L Lᵀ = Σ a aᵀ / n.
    factor: [Row; FUNCTIONS],
}

impl Coverage {
    /// Of unit vectors.
    pub fn of(units: impl Iterator<Item = [f64; 3]>) -> Self {
        let mut factor = [[0.0; FUNCTIONS]; FUNCTIONS];
        let mut count: f32 = 0.0;
        for unit in units {
            let row = functions(unit);
            for (sums, of_row) in factor.iter_mut().zip(row) {
                sums.iter_mut().zip(row).for_each(|(sum, of_column)| *sum += of_row * of_column);
            }
            count += 1.0;
        }
        Self::with(factor, count.max(1.0))
    }

    /// Factors the sum of so many (Cholesky). Never inlined, so that there is one of it whatever the vectors come from.
    #[inline(never)]
    fn with(mut factor: [Row; FUNCTIONS], count: f32) -> Self {
        for i in 0..FUNCTIONS {
            let (above, below) = factor.split_at_mut(i);
            let Some(row) = below.first_mut() else { break };
            row.iter_mut().for_each(|sum| *sum /= count);
            for (j, earlier) in above.iter().enumerate() {
                let (known, rest) = row.split_at_mut(j);
                if let (Some(place), Some(pivot)) = (rest.first_mut(), earlier.get(j)) {
                    *place = (*place - product(known, earlier)) / pivot;
                }
            }
            let (known, rest) = row.split_at_mut(i);
            if let Some(place) = rest.first_mut() {
                *place = libm::sqrtf((*place + LEAST - product(known, known)).max(LEAST));
            }
        }
        Self { factor }
    }

    /// In a direction: 1 or more where an even cover would know it no better, towards 0 where it is unknown.
    pub fn towards(&self, unit: [f64; 3]) -> f64 {
        let mut solved = functions(unit);
        for (i, row) in self.factor.iter().enumerate() {
            let (known, rest) = solved.split_at_mut(i);
            if let (Some(place), Some(pivot)) = (rest.first_mut(), row.get(i)) {
                *place = (*place - product(known, row)) / pivot;
            }
        }
        f64::from(FUNCTIONS as f32 / product(&solved, &solved))
    }

    /// Over the sphere: 0 … 1, to three digits.
    pub fn least(&self) -> f64 {
        Direction::all().map(|direction| self.towards(direction.unit())).fold(1.0, f64::min)
    }

    /// The direction that is known worst.
    pub fn worst(&self) -> Direction {
        let mut worst = (f64::INFINITY, Direction([0, 0, 1]));
        for direction in Direction::all() {
            let coverage = self.towards(direction.unit());
            if coverage < worst.0 {
                worst = (coverage, direction);
            }
        }
        worst.1
    }

    /// Whether a direction is known worse than [`LEAST_COVERAGE`].
    pub fn is_missing(&self, direction: Direction) -> bool {
        self.towards(direction.unit()) < LEAST_COVERAGE
    }
}

/// Sum of the products of what both have.
fn product(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    fn units(wanted: impl Fn(&Direction) -> bool) -> Vec<[f64; 3]> {
        Direction::all().filter(wanted).map(Direction::unit).collect()
    }

    fn coverage(units: &[[f64; 3]]) -> Coverage {
        Coverage::of(units.iter().copied())
    }

    #[test]
    fn directions_have_names() {
        assert_eq!(Direction::all().count(), 26);
        assert_eq!(Direction([0, 0, -1]).to_string(), "-z");
        assert_eq!(Direction([1, -1, 0]).to_string(), "+x-y");
        let [x, y, z] = Direction([1, -1, 0]).unit();
        let half_right = core::f64::consts::FRAC_1_SQRT_2;
        assert!((x - half_right).abs() < 1e-5 && (y + half_right).abs() < 1e-5 && z == 0.0);
    }

    #[test]
    fn an_even_cover_is_one() {
        // The twelve corners of the icosahedron integrate polynomials up to the fifth degree exactly: an optimal design.
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let norm = (1.0 + golden * golden).sqrt();
        let mut corners = Vec::new();
        for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let (short, long) = (a / norm, b * golden / norm);
            corners.extend([[0.0, short, long], [short, long, 0.0], [long, 0.0, short]]);
        }
        assert!((coverage(&corners).least() - 1.0).abs() < 1e-6, "{}", coverage(&corners).least());
    }

    #[test]
    fn axes_alone_do_not_show_non_orthogonality() {
        let axes = units(|direction| direction.0.iter().filter(|part| **part != 0).count() == 1);
        let coverage = coverage(&axes);
        // The three products are not known at all; along a corner their squares add up to 3 · (1/3)²: 9 · 10⁻⁵ / (1/3).
        assert!(coverage.least() < 2.7e-4);
        assert!(!coverage.is_missing(Direction([1, 0, 0])) && coverage.is_missing(Direction([1, 1, 0])));
    }

    #[test]
    fn a_hemisphere_lacks_the_other() {
        let coverage = coverage(&units(|direction| direction.0[2] >= 0));
        assert_eq!(coverage.worst(), Direction([0, 0, -1]));
        assert!(coverage.least() < 0.02 && coverage.least() > 0.01, "{}", coverage.least());
        let high = Coverage::of(units(|direction| direction.0[2] > 0).into_iter());
        assert!(high.is_missing(Direction([0, 0, -1])) && high.least() < 0.01, "{}", high.least());
    }

    #[test]
    fn nothing_covers_nothing() {
        // Along an axis the squares of the functions add up to 1 + 1: 9 · 10⁻⁵ / 2.
        assert!((coverage(&[]).least() - 4.5e-5).abs() < 1e-9);
    }
}

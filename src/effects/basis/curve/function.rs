//! Functions of a signal: powers, a smooth curve, a table.

use core::fmt;

use heapless::Vec;
use quantities::limits::{Invalid, finite, within};
use serde::{Deserialize, Serialize};

use super::super::{MAX_FUNCTIONS, Values, values_of};

/// Knots in the signal's unit, rising.
pub type Knots = Vec<f32, MAX_FUNCTIONS>;

/// Functions of a signal x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Function {
    /// u, u² … u^degree (1 … 3) with u = x − reference.
    Powers { reference: f32, degree: u8 },
    /// The functions that natural cubic splines through these knots (three or more) are made of; one fewer than knots.
    Spline(Knots),
    /// Hats over these knots (two or more), one a knot: 1 there, 0 at its neighbours, straight between; constant beyond the
    /// outer ones. Coefficients are the values at the knots.
    Table(Knots),
}

impl Function {
    pub fn count(&self) -> usize {
        match self {
            Self::Powers { degree, .. } => (*degree).into(),
            Self::Spline(knots) => knots.len().saturating_sub(1),
            Self::Table(knots) => knots.len(),
        }
    }

    pub fn values(&self, x: f64) -> Values {
        match self {
            &Self::Powers { reference, degree } => values_of((0..degree).scan(1.0, |power, _| {
                *power *= x - f64::from(reference);
                Some(*power)
            })),
            Self::Spline(knots) => values_of((0..self.count()).map(|j| spline(knots, j, x))),
            Self::Table(knots) => values_of((0..knots.len()).map(|j| hat(knots, j, x))),
        }
    }

    pub fn knots(&self) -> &[f32] {
        match self {
            Self::Powers { .. } => &[],
            Self::Spline(knots) | Self::Table(knots) => knots,
        }
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        let fewest = match self {
            &Self::Powers { reference, degree } => {
                finite("model.terms.basis.curve.function.powers.reference", &[reference.into()])?;
                return within("model.terms.basis.curve.function.powers.degree", degree.into(), 1.0, 3.0, "1 to 3");
            }
            Self::Spline(_) => 3.0,
            Self::Table(_) => 2.0,
        };
        let field = "model.terms.basis.curve.function (knots)";
        let number = self.knots().len() as f64;
        within(field, number, fewest, MAX_FUNCTIONS as f64, "2 (of a spline 3) to 7 knots")?;
        for pair in self.knots().windows(2) {
            if let &[below, above] = pair
                && !(above > below && above - below < f32::INFINITY)
            {
                return Err(Invalid::new(field, above.into(), "finite, above the knot before it"));
            }
        }
        Ok(())
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Powers { degree: 0 | 1, .. } => "",
            Self::Powers { degree: 2, .. } => "-quadratic",
            Self::Powers { .. } => "-cubic",
            Self::Spline(_) => "-spline",
            Self::Table(_) => "-table",
        })
    }
}

/// Number `j` of the functions that natural cubic splines with these knots are made of: the first is `x` above the first
/// knot, the others vanish below their own knot and have the unit of `x` too (Stone and Koo, Proc. Stat. Comp. ASA, 1985,
/// p. 45). Straight beyond the outer knots.
fn spline(knots: &[f32], j: usize, x: f64) -> f64 {
    let &[first, .., before, last] = knots else { return 0.0 };
    let [first, before, last] = [first, before, last].map(f64::from);
    let Some(own) = j.checked_sub(1) else { return x - first };
    let Some(&knot) = knots.get(own) else { return 0.0 };
    let knot = f64::from(knot);
    let cube = |from: f64| {
        let above = (x - from).max(0.0);
        above * above * above
    };
    let bent =
        cube(knot) - cube(before) * (last - knot) / (last - before) + cube(last) * (before - knot) / (last - before);
    bent / ((last - first) * (last - first))
}

/// The hat over knot `j`.
fn hat(knots: &[f32], j: usize, x: f64) -> f64 {
    let Some(&knot) = knots.get(j) else { return 0.0 };
    let knot = f64::from(knot);
    let neighbour = if x < knot { j.checked_sub(1).and_then(|below| knots.get(below)) } else { knots.get(j + 1) };
    // Beyond the outer knots there is no neighbour: constant.
    neighbour.map_or(1.0, |&neighbour| (1.0 - (x - knot) / (f64::from(neighbour) - knot)).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOTS: [f32; 4] = [0.0, 1.0, 2.0, 4.0];

    #[test]
    fn a_spline_by_hand() {
        // Knot 0: 3³ − 1³ · (4 − 0)/2 + 0, over 4². Knot 1: 2³ − 1³ · (4 − 1)/2 + 0, over 4².
        let spline = Function::Spline(KNOTS.into_iter().collect());
        assert_eq!(spline.values(3.0), [3.0, 25.0 / 16.0, 6.5 / 16.0]);
        // Straight beyond the knots: second differences vanish.
        for x in [-5.0, 7.0, 50.0] {
            let [below, here, above] = [x - 1.0, x, x + 1.0].map(|x| spline.values(x));
            for j in 0..3 {
                assert!((below[j] - 2.0 * here[j] + above[j]).abs() < 1e-9, "{j} {x}");
            }
        }
    }

    #[test]
    fn a_table_by_hand() {
        let table = Function::Table(KNOTS.into_iter().collect());
        assert_eq!(table.values(-7.0), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(table.values(0.25), [0.75, 0.25, 0.0, 0.0]);
        assert_eq!(table.values(2.0), [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(table.values(3.0), [0.0, 0.0, 0.5, 0.5]);
        assert_eq!(table.values(9.0), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn knots_must_rise() {
        let unsorted = Function::Spline([0.0, 3.0, 1.0].into_iter().collect());
        assert_eq!(unsorted.validate().unwrap_err().value, 1.0);
        assert!(Function::Table([1.0].into_iter().collect()).validate().is_err());
    }
}

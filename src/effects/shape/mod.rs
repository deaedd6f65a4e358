//! Shapes: functions of a signal, one or several. One file a shape, and one line here.

use core::fmt;

use heapless::Vec;
use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::part::{Constants, Span, parts};
use crate::bounded::bounded;

/// Most functions of one shape.
pub const MAX_FUNCTIONS: usize = 16;

/// Values of a shape's functions.
pub type Values = Vec<f64, MAX_FUNCTIONS>;

/// What every shape says of itself.
pub trait ShapePart {
    /// How many functions there are.
    fn count(&self) -> usize;
    /// Their values.
    fn values(&self, x: f64) -> Values;
    /// Standard deviation of the weight of the function of that number, from 0, before anything is learned: relative to the effect's size.
    fn prior(&self, _number: usize) -> f64 {
        1.0
    }
    /// Its name, lower case, with hyphens.
    fn name(&self) -> &'static str;
    /// The numbers that the search tunes.
    fn constants(&self) -> Constants;
    /// Sets the constant of that number.
    fn set(&mut self, _number: usize, _value: f64) {}
    /// Constants in their range.
    fn validate(&self) -> Result<(), Invalid>;
    /// It jumps where its input passes one of its constants.
    fn jumps(&self) -> bool {
        false
    }
}

parts! {
    /// A shape.
    Shape is ShapePart of
    linear::Linear,
    harmonic::Harmonic,
    circular::Circular,
    smooth::Smooth,
    sharp::Sharp,
    hinge::Hinge,
    broken::Broken,
    step::Step,
    bump::Bump,
    sector::Sector,
    decay::Decay,
    saturation::Saturation,
}

impl Shape {
    /// How many functions there are.
    pub fn count(&self) -> usize {
        self.part().count()
    }

    /// Their values.
    pub fn values(&self, x: f64) -> Values {
        self.part().values(x)
    }

    /// Standard deviation of a weight before anything is learned, relative to the effect's size.
    pub fn prior(&self, number: usize) -> f64 {
        self.part().prior(number)
    }

    pub fn constants(&self) -> Constants {
        self.part().constants()
    }

    pub fn set(&mut self, number: usize, value: f64) {
        self.part_mut().set(number, value);
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        self.part().validate()
    }

    pub fn jumps(&self) -> bool {
        self.part().jumps()
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.part().name())
    }
}

/// cos(π j u) for j = 1 … count, u = the place of x between `low` and `high`, from 0 to 1: the functions that smooth curves on an interval are
/// made of (Solin and Särkkä, Statistics and Computing 30, 2020, p. 419). Constant beyond the interval.
fn cosines(x: f64, low: f32, high: f32, count: usize) -> Values {
    let u = ((x - f64::from(low)) / f64::from(high - low)).clamp(0.0, 1.0);
    let cos = libm::cos(core::f64::consts::PI * u);
    let (mut before, mut last) = (1.0, cos);
    let mut values = Values::new();
    for _ in 0..count.min(MAX_FUNCTIONS) {
        let _ = values.push(last);
        (before, last) = (last, 2.0 * cos * last - before);
    }
    values
}

/// Limits of a curve's interval and count.
fn interval(field: &'static str, low: f32, high: f32) -> Result<(), Invalid> {
    if high > low && (high - low).is_finite() {
        Ok(())
    } else {
        Err(Invalid::new(field, high.into(), "finite, above `low`"))
    }
}

/// One function.
fn one(value: f64) -> Values {
    bounded([value])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: at a quarter of the interval cos(π j/4) = 1/√2, 0, −1/√2, −1; beyond it as at its end.
    #[test]
    fn cosines_by_hand() {
        let root = core::f64::consts::FRAC_1_SQRT_2;
        for (found, expected) in cosines(1.0, 0.0, 4.0, 4).iter().zip([root, 0.0, -root, -1.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert_eq!(cosines(9.0, 0.0, 4.0, 3), cosines(4.0, 0.0, 4.0, 3));
    }

    /// A bump about north: 350° and 10° lie 20° apart, two widths of 10° each from its middle at 10°.
    #[test]
    fn a_bump_of_an_angle_goes_round() {
        let bump = Shape::from(Bump { centre: 10.0, width: 10.0, circular: true });
        assert!((bump.values(350.0)[0] - libm::exp(-2.0)).abs() < 1e-12);
        // From 350° through north to 80°.
        let sector = Shape::from(Sector { from: 350.0, to: 440.0 });
        assert_eq!([340.0, 355.0, 79.0, 81.0].map(|x| sector.values(x)[0]), [0.0, 1.0, 1.0, 0.0]);
        let saturation = Shape::from(Saturation { centre: 2.0, width: 0.5 });
        assert!((saturation.values(2.5)[0] - libm::tanh(1.0)).abs() < 1e-12 && saturation.values(-90.0)[0] == -1.0);
        let hinge = Shape::from(Hinge { at: 2.0, scale: 0.5 });
        assert_eq!((hinge.values(1.0).as_slice(), hinge.values(3.0).as_slice()), (&[-2.0, 0.0][..], &[0.0, 2.0][..]));
        let broken = Shape::from(Broken { first: 2.0, second: 4.0, scale: 0.5 });
        assert_eq!(broken.values(1.0).as_slice(), [-2.0, 0.0, 0.0]);
        assert_eq!(broken.values(3.0).as_slice(), [0.0, 2.0, 0.0]);
        assert_eq!(broken.values(5.0).as_slice(), [0.0, 4.0, 2.0]);
    }
}

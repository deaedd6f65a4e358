//! A bump: a sector of angles, a resonance, a dead zone.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, finite, positive};

use super::{Shape, ShapePart, Values, one};
use crate::effects::part::{Constant, Constants, Span, constants};
use crate::units::wrap_180_deg;

/// exp(−u²/2), u = (x − centre)/width. Of an angle the distance is the shorter way about the circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bump {
    pub centre: f32,
    pub width: f32,
    /// The signal is an angle in degrees.
    pub circular: bool,
}

/// Width that the search begins with, as a share of the range, or of a circle.
pub(super) const SHARE: f64 = 0.12;
/// Starts about a circle: at a width of an eighth neighbours overlap by half.
const SECTORS: u8 = 8;

impl Bump {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Shape)) {
        if span.is_angle {
            let width = (SHARE * 360.0) as f32;
            let centre = |sector| 360.0 / f32::from(SECTORS) * f32::from(sector);
            (0..SECTORS).for_each(|sector| each(Self { centre: centre(sector), width, circular: true }.into()));
            return;
        }
        let width = (SHARE * (span.high - span.low)) as f32;
        span.places().for_each(|centre| each(Self { centre: centre as f32, width, circular: false }.into()));
    }
}

impl ShapePart for Bump {
    fn count(&self) -> usize {
        1
    }

    fn values(&self, x: f64) -> Values {
        let away = x - f64::from(self.centre);
        let u = if self.circular { wrap_180_deg(away) } else { away } / f64::from(self.width);
        one(libm::exp(-0.5 * u * u))
    }

    fn name(&self) -> &'static str {
        "bump"
    }

    fn constants(&self) -> Constants {
        constants([Constant::place("centre", self.centre), Constant::scale("width", self.width)])
    }

    fn set(&mut self, number: usize, value: f64) {
        if number == 0 {
            self.centre = value as f32;
        } else {
            self.width = value as f32;
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        finite("model.effects.factors.shape.bump.centre", &[self.centre.into()])?;
        positive("model.effects.factors.shape.bump.width", self.width.into())
    }
}

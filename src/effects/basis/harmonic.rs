//! A field fixed to the instrument's body: harmonics of the index angle.

use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

use super::{Functions, Missing, Now, Values, values_of};
use crate::sensing::index::Direction;

/// cos(order · θ) and sin(order · θ).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyHarmonic {
    /// 1 … 36.
    pub order: u8,
}

impl Functions for BodyHarmonic {
    fn count(&self) -> usize {
        2
    }

    fn values(&self, now: &Now<'_>, _: &mut Option<f64>) -> Result<Values, Missing> {
        let Direction { cos, sin } = now.conditions.index.ok_or(Missing::Absent)?;
        let angle = f64::from(self.order) * libm::atan2(sin, cos);
        Ok(values_of([libm::cos(angle), libm::sin(angle)]))
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.terms.basis.body-harmonic.order", self.order.into(), 1.0, 36.0, "1 to 36")
    }

    fn coefficient_names(&self) -> &'static [&'static str] {
        &["cos_deg_h", "sin_deg_h"]
    }

    fn words(&self) -> &'static str {
        "a rate fixed to the instrument's body, a harmonic of the index angle"
    }
}

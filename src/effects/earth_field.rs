//! Fields fixed to the Earth, which the gyro takes for rates: the Earth's magnetic field on an unshielded coil.

use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

use crate::earth::EarthRate;
use crate::units::{DEG_PER_RAD, wrap_360_deg};

/// Adds east_deg_h · sin α + north_deg_h · cos α, α the azimuth of the axis. Turns the answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EarthField {
    pub east_deg_h: f64,
    pub north_deg_h: f64,
}

impl EarthField {
    /// True azimuth from the one that the rates gave. A field of east e and north n adds e sin α + n cos α to h cos α: the
    /// sum is a cosine about the azimuth less atan(e / (h + n)).
    pub fn true_azimuth_deg(&self, azimuth_deg: f64, earth: &EarthRate) -> f64 {
        if self.east_deg_h == 0.0 {
            return azimuth_deg;
        }
        let turned = libm::atan2(self.east_deg_h, earth.north_deg_h + self.north_deg_h);
        wrap_360_deg(azimuth_deg + turned * DEG_PER_RAD)
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        // A field that were larger than the Earth's rate would be measured in its place.
        let within_limit = |value: f64| within("model.earth_field", value, -10.0, 10.0, "-10 to 10");
        [self.east_deg_h, self.north_deg_h].into_iter().try_for_each(within_limit)
    }
}

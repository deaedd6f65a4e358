//! Motion of the base, as the accelerometers feel it: taken out of the rate row by row.

use quantities::limits::{Invalid, within};
use serde::{Deserialize, Serialize};

/// How the accelerometers feel the base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BaseMotion {
    /// Their noise is white in the velocity (counts of velocity increments, shocks), not in the tilt.
    pub velocity: bool,
    /// Their readings come this much later than the gyro's, seconds, −10 … 10: a filter, or (below 0) readings of the end of a
    /// row instead of means over it.
    pub lag_s: f64,
}

impl BaseMotion {
    pub fn validate(&self) -> Result<(), Invalid> {
        within("model.base_motion.lag_s", self.lag_s, -10.0, 10.0, "-10 to 10")
    }
}

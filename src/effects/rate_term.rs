//! What the gyro makes of the rate itself, beyond a scale factor: curves and a dead zone.

use core::fmt;

use quantities::limits::{Invalid, finite, positive, within};
use serde::{Deserialize, Serialize};

/// An effect of the rate. ω, °/h, is the true rate, without the other effects, less `centre_deg_h`. The centre is the usual bias where the bias is outside
/// of the distortion, else 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum RateTerm {
    /// coefficient · ω^power, power 2 or 3, °/h per (°/h)^power.
    Power { centre_deg_h: f64, power: u8, coefficient: f64 },
    /// Lost near zero rate, at most `depth_deg_h`, there where ω = ± `width_deg_h`.
    DeadZone { centre_deg_h: f64, depth_deg_h: f64, width_deg_h: f64, form: DeadZoneForm },
}

/// How the loss about zero rate goes with x = ω/width; 1 at x = 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeadZoneForm {
    /// x · exp((1 − x²)/2): gone well beyond the width.
    Short,
    /// x · exp(1 − |x|).
    Middle,
    /// 2x/(1 + x²): a long tail.
    Long,
    /// x up to the width, beyond x − √(x² − 1): two waves that lock (Aronowitz, The laser gyro, 1971).
    Lock,
}

impl DeadZoneForm {
    pub const ALL: [Self; 4] = [Self::Short, Self::Middle, Self::Long, Self::Lock];

    /// The loss at `x`, odd.
    pub fn at(self, x: f64) -> f64 {
        match self {
            Self::Short => x * libm::exp(0.5 * (1.0 - x * x)),
            Self::Middle => x * libm::exp(1.0 - x.abs()),
            Self::Long => 2.0 * x / (1.0 + x * x),
            Self::Lock if x.abs() <= 1.0 => x,
            Self::Lock => x - libm::copysign(libm::sqrt(x * x - 1.0), x),
        }
    }
}

impl RateTerm {
    /// What it adds to a true rate, °/h.
    pub fn of_rate_deg_h(&self, rate_deg_h: f64) -> f64 {
        match *self {
            Self::Power { centre_deg_h, power, coefficient } => {
                let rate = rate_deg_h - centre_deg_h;
                coefficient * rate * rate * if power == 3 { rate } else { 1.0 }
            }
            Self::DeadZone { centre_deg_h, depth_deg_h, width_deg_h, form } => {
                -depth_deg_h * form.at((rate_deg_h - centre_deg_h) / width_deg_h)
            }
        }
    }

    /// The same of another size.
    pub fn with_coefficient(mut self, value: f64) -> Self {
        match &mut self {
            Self::Power { coefficient, .. } => *coefficient = value,
            Self::DeadZone { depth_deg_h, .. } => *depth_deg_h = value,
        }
        self
    }

    /// The same with another width; a power has none.
    pub fn with_constant(mut self, value: f64) -> Self {
        if let Self::DeadZone { width_deg_h, .. } = &mut self {
            *width_deg_h = value;
        }
        self
    }

    /// Name of the coefficient, and of the width if there is one.
    pub fn parameter_names(&self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Power { power: 2, .. } => ("per_deg_h", None),
            Self::Power { .. } => ("per_deg_h2", None),
            Self::DeadZone { .. } => ("depth_deg_h", Some("width_deg_h")),
        }
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        match *self {
            Self::Power { centre_deg_h, power, coefficient } => {
                within("model.rate_terms.power.power", power.into(), 2.0, 3.0, "2 or 3")?;
                finite("model.rate_terms.power", &[centre_deg_h, coefficient])
            }
            Self::DeadZone { centre_deg_h, depth_deg_h, width_deg_h, .. } => {
                positive("model.rate_terms.dead-zone.width_deg_h", width_deg_h)?;
                finite("model.rate_terms.dead-zone", &[centre_deg_h, depth_deg_h])
            }
        }
    }
}

/// The stable name.
impl fmt::Display for RateTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Power { power: 2, .. } => "rate-quadratic",
            Self::Power { .. } => "rate-cubic",
            Self::DeadZone { .. } => "dead-zone",
        })
    }
}

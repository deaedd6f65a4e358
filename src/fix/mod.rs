//! Rates at index angles to azimuth, sigma and closure.
//!
//! A gyro whose sensitive axis is at index θ on an instrument with azimuth ψ, pitch p and roll r reads
//!
//! ω = h·(C cos ψ + S sin ψ) + Ω sin φ · (upward component of the axis) + bias + drift · t,
//!
//! with h = Ω cos φ, C = cos θ cos p − sin θ sin r sin p and S = sin θ cos r: linear in h cos ψ, h sin ψ, bias and drift.
//! (Level, this is ω = h cos(ψ − θ) + bias.) The solution is weighted least squares with the amplitude free; for four
//! positions of equal length it is ψ = atan2(ω90 − ω270, ω0 − ω180).
//!
//! Sigma comes from the scatter of the data, never below what the declared noise allows, and grows where the dwells do
//! not fit together; the declared bias instability, encoder and level errors are added, and what is not certain of the
//! error model (`doubt`).

pub mod accumulator;
mod accuracy;
mod azimuth_effects;
mod azimuth_posterior;
pub mod base_motion;
mod cause;
mod causes;
mod closure;
pub mod design;
mod directions;
mod doubt;
pub mod dwell;
mod dwells;
mod estimate;
pub mod heading;
pub mod index_watch;
mod motion;
pub mod moving_base;
mod noise;
mod observation;
mod problem;
mod robust;
pub mod rotation;
pub mod sinusoid;
mod solution;
pub mod statistics;
#[cfg(test)]
mod tests;
mod turned;
mod velocity;
pub mod way;

use serde::{Deserialize, Serialize};

use crate::earth::EarthRate;
use crate::health::{Fault, Flags};
use crate::sensing::level::{LevelDrift, Tilt};
use crate::sensing::sample::GyroSettings;
pub use causes::solve;
pub use design::DesignRow;
pub use directions::{coarse_azimuth_deg, east_index_deg, west_index_deg, white_noise_bound_deg};

/// What a solution rests on beside the data: what is declared of the instrument, and the Earth's rate at its site.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Declared {
    pub earth: EarthRate,
    pub gyro: GyroSettings,
    /// One sigma of the encoder's error at one position, degrees.
    pub index_sigma_deg: f64,
    /// One sigma of the accelerometers' level error, degrees.
    pub level_sigma_deg: f64,
    /// What their readings do though the base stands still.
    pub level_drift: LevelDrift,
    /// An error model from a calibration is stored.
    pub calibrated: bool,
    /// A calibration of the level accelerometers is stored.
    pub level_calibrated: bool,
}

/// An azimuth with all that says how far to trust it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// Azimuth of the index-zero mark, degrees clockwise from true north, in [0°, 360°).
    pub azimuth_deg: f64,
    /// Its standard deviation, degrees.
    pub sigma_deg: f64,
    /// (ω0 + ω180 − ω90 − ω270)/4 and, for any other set of angles, the cos 2θ coefficient of the rates, °/h;
    /// `None` where the angles do not determine it. Noise, when all is well.
    pub closure_deg_h: Option<f64>,
    /// Its standard deviation, °/h.
    pub closure_sigma_deg_h: Option<f64>,
    /// How the dwells fit together: sum of the squares of what their means and slopes are off by, over their variances; and the degrees
    /// of freedom, of which there are as many as it is on average (0: nothing contradicts).
    pub chi_square: f64,
    pub degrees_of_freedom: u16,
    /// Gyro bias that the fix found, °/h, beyond the error model's.
    pub bias_deg_h: f64,
    /// Horizontal rate that the fix found, °/h; should be Ω cos φ.
    pub amplitude_deg_h: f64,
    /// Linear bias drift that the fix found, °/h per hour; 0 where the order cannot tell it and none was declared.
    pub drift_deg_h_per_h: f64,
    /// Mean tilt during the fix; `None` without level accelerometers.
    pub tilt: Option<Tilt>,
    /// Measuring time that entered, seconds.
    pub seconds: f64,
    /// Everything that limits the trust in it.
    pub flags: Flags,
}

/// Why there is no azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsolvable {
    /// Fewer than three different directions.
    TooFewDirections,
    /// The horizontal rate is not significant against its own uncertainty.
    NoSignal,
    /// The horizontal rate is significant, and not the Earth's at this latitude or one near it.
    NotEarthRate,
    /// More dwells than there is room for.
    TooManyDwells,
}

impl Unsolvable {
    /// The fault that ends a fix with it.
    pub fn fault(self) -> Fault {
        match self {
            Self::NoSignal => Fault::NoEarthRate,
            Self::NotEarthRate => Fault::NotEarthRate,
            Self::TooFewDirections | Self::TooManyDwells => Fault::Unsolvable,
        }
    }
}

impl core::fmt::Display for Unsolvable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooFewDirections => "the gyro was at rest in fewer than three different directions",
            Self::NoSignal => "Earth rate not detected above the noise; no azimuth",
            Self::NotEarthRate => {
                "the horizontal rate is not the Earth's, whatever scale factor and latitude error are granted; no azimuth"
            }
            Self::TooManyDwells => "more dwells than there is room for",
        })
    }
}

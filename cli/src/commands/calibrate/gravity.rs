//! The option that says what a triad at rest feels.

use clap::Args;
use north_finder::earth::normal_gravity_m_s2;

use crate::commands::number;

/// Gravity: given, or by latitude and height, or the unit itself.
#[derive(Args, Debug)]
pub struct Gravity {
    /// Norm of specific force at rest, in the unit that is wanted: 9.81 for m/s2
    #[arg(long, value_name = "G", value_parser = gravity)]
    gravity: Option<f64>,
    /// Latitude, degrees, north positive: gravity follows from it, in m/s2
    #[arg(long, value_name = "DEG", conflicts_with = "gravity", allow_negative_numbers = true,
          value_parser = number::<-90, 90>)]
    latitude: Option<f64>,
    /// Height above the ellipsoid, m
    #[arg(long, value_name = "M", default_value_t = 0.0, requires = "latitude", allow_negative_numbers = true,
          value_parser = number::<-1000, 10_000>)]
    height: f64,
}

fn gravity(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(gravity) if (1e-30..=1e30).contains(&gravity) => Ok(gravity),
        _ => Err("allowed is a number from 1e-30 to 1e30".into()),
    }
}

impl Gravity {
    /// The norm of specific force at rest, in the unit that is wanted.
    pub fn norm(&self) -> f64 {
        match (self.gravity, self.latitude) {
            (Some(gravity), _) => gravity,
            (None, Some(latitude_deg)) => normal_gravity_m_s2(latitude_deg.to_radians(), self.height),
            (None, None) => 1.0,
        }
    }

    /// Where it is from, in a sentence.
    pub fn said(&self) -> String {
        let norm = self.norm();
        match (self.gravity, self.latitude) {
            (Some(_), _) => format!("gravity {norm}, as given"),
            (None, Some(latitude_deg)) => {
                format!("gravity {norm:.6} m/s2: normal gravity (WGS 84) at {latitude_deg} deg, {} m", self.height)
            }
            (None, None) => {
                "gravity 1: forces are in units of the local gravity, whatever it is; --latitude and --height \
                             give them in m/s2"
                    .into()
            }
        }
    }
}

//! Azimuths as their users write them: degrees, gon, mils or degrees-minutes-seconds, from grid north, and to a target.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use north_finder::units::wrap_360_deg;

/// How an angle is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum AngleUnit {
    /// decimal degrees
    #[default]
    Deg,
    /// gon, 400 to a turn
    Gon,
    /// mils, 6400 to a turn
    Mil,
    /// degrees, minutes and seconds
    Dms,
}

impl AngleUnit {
    /// An azimuth in [0, one turn), rounded to about a third of an arcsecond.
    pub fn azimuth(self, azimuth_deg: f64) -> String {
        let decimal = |per_turn: f64, decimals: usize, unit: &str| {
            let text = format!("{:.decimals$}", wrap_360_deg(azimuth_deg) / 360.0 * per_turn);
            // What rounds up to a full turn is nothing.
            let full = format!("{per_turn:.decimals$}");
            format!("{}{unit}", if text == full { format!("{:.decimals$}", 0.0) } else { text })
        };
        match self {
            Self::Deg => decimal(360.0, 4, "°"),
            Self::Gon => decimal(400.0, 4, " gon"),
            Self::Mil => decimal(6400.0, 3, " mil"),
            Self::Dms => {
                let tenths = (wrap_360_deg(azimuth_deg) * 36_000.0).round() as u64 % (360 * 36_000);
                dms(tenths)
            }
        }
    }

    /// A standard deviation, 0 or more.
    pub fn sigma(self, sigma_deg: f64) -> String {
        match self {
            Self::Deg => format!("{sigma_deg:.4}°"),
            Self::Gon => format!("{:.4} gon", sigma_deg / 360.0 * 400.0),
            Self::Mil => format!("{:.3} mil", sigma_deg / 360.0 * 6400.0),
            Self::Dms => dms((sigma_deg * 36_000.0).round() as u64),
        }
    }
}

/// From tenths of an arcsecond.
fn dms(tenths: u64) -> String {
    let (seconds, tenth) = (tenths / 10, tenths % 10);
    format!("{}°{:02}'{:02}.{tenth}\"", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

/// What else an azimuth is wanted as.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Directions {
    /// Unit of the azimuth and its sigma
    #[arg(long, value_enum, default_value_t)]
    unit: AngleUnit,
    /// Grid convergence at the site, degrees: the azimuth of grid north, clockwise from true north; the grid azimuth is
    /// printed too
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = crate::argument::number::<-180, 180>)]
    convergence: Option<f64>,
    /// Horizontal angle from the index-zero mark clockwise to a target, degrees; the target's azimuth is printed too
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = crate::argument::number::<-360, 360>)]
    target: Option<f64>,
}

impl Directions {
    /// The azimuth with its sigma, and what else was asked for, a line each.
    pub fn write(&self, out: &mut dyn Write, azimuth_deg: f64, sigma_deg: f64) -> io::Result<()> {
        let sigma = self.unit.sigma(sigma_deg);
        let mut line =
            |name: &str, angle_deg: f64| writeln!(out, "{name:<10} {} ± {sigma}", self.unit.azimuth(angle_deg));
        line("azimuth", azimuth_deg)?;
        if let Some(convergence_deg) = self.convergence {
            line("grid", azimuth_deg - convergence_deg)?;
        }
        if let Some(target_deg) = self.target {
            line("target", azimuth_deg + target_deg)?;
            if let Some(convergence_deg) = self.convergence {
                line("target grid", azimuth_deg + target_deg - convergence_deg)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_angle_in_every_unit_by_hand() {
        // 39.97404°: · 10/9 = 44.41560 gon; · 160/9 = 710.6496 mil; 0.97404 · 60 = 58.4424′, 0.4424 · 60 = 26.5″.
        assert_eq!(AngleUnit::Deg.azimuth(39.97404), "39.9740°");
        assert_eq!(AngleUnit::Gon.azimuth(39.97404), "44.4156 gon");
        assert_eq!(AngleUnit::Mil.azimuth(39.97404), "710.650 mil");
        assert_eq!(AngleUnit::Dms.azimuth(39.97404), "39°58'26.5\"");
        assert_eq!(AngleUnit::Dms.sigma(0.0415), "0°02'29.4\"");
    }

    #[test]
    fn nothing_rounds_up_to_a_full_turn() {
        for (unit, zero) in [
            (AngleUnit::Deg, "0.0000°"),
            (AngleUnit::Gon, "0.0000 gon"),
            (AngleUnit::Mil, "0.000 mil"),
            (AngleUnit::Dms, "0°00'00.0\""),
        ] {
            assert_eq!(unit.azimuth(359.999_999), zero);
        }
    }

    #[test]
    fn grid_and_target_by_hand() {
        // Grid north 1.5° east of true north: every grid azimuth is 1.5° smaller. The target stands 330° from the mark.
        let directions = Directions { unit: AngleUnit::Deg, convergence: Some(1.5), target: Some(330.0) };
        let mut out = Vec::new();
        directions.write(&mut out, 40.0, 0.04).unwrap();
        let text = String::from_utf8(out).unwrap();
        let expected = "azimuth    40.0000° ± 0.0400°\ngrid       38.5000° ± 0.0400°\n\
                        target     10.0000° ± 0.0400°\ntarget grid 8.5000° ± 0.0400°\n";
        assert_eq!(text, expected);
    }
}

//! Azimuths as their users write them: degrees, gon, mils or degrees-minutes-seconds, from grid north, and to a target.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use north_finder::units::wrap_360_deg;
use schemars::JsonSchema;
use serde::Serialize;

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

    /// As the option is written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Gon => "gon",
            Self::Mil => "mil",
            Self::Dms => "dms",
        }
    }

    /// An angle for programs: all digits of a number, and text where the unit has no number.
    fn written(self, angle_deg: f64, text: String) -> Written {
        match self {
            Self::Deg => Written::Number(angle_deg),
            Self::Gon => Written::Number(angle_deg / 360.0 * 400.0),
            Self::Mil => Written::Number(angle_deg / 360.0 * 6400.0),
            Self::Dms => Written::Text(text),
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

/// An angle in the unit that was asked for: a number, or degrees, minutes and seconds as text.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Written {
    Number(f64),
    Text(String),
}

/// An azimuth as it was asked for, for programs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Asked {
    /// "deg", "gon", "mil" or "dms": of the angles here.
    pub unit: &'static str,
    /// As asked, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub convergence: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<f64>,
    /// One sigma of each of the azimuths.
    pub sigma: Written,
    pub azimuth: Written,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_azimuth: Option<Written>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_azimuth: Option<Written>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_grid_azimuth: Option<Written>,
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
    /// The unit of the angles.
    pub fn unit(&self) -> AngleUnit {
        self.unit
    }

    /// The azimuth and what else was asked for, with their names, degrees.
    pub fn angles_deg(&self, azimuth_deg: f64) -> impl Iterator<Item = (&'static str, f64)> {
        let (convergence, target) = (self.convergence, self.target);
        [
            Some(("azimuth", azimuth_deg)),
            convergence.map(|convergence_deg| ("grid", azimuth_deg - convergence_deg)),
            target.map(|target_deg| ("target", azimuth_deg + target_deg)),
            target
                .zip(convergence)
                .map(|(target_deg, convergence_deg)| ("target grid", azimuth_deg + target_deg - convergence_deg)),
        ]
        .into_iter()
        .flatten()
    }

    /// The azimuth with its sigma, and what else was asked for, a line each.
    pub fn write(&self, out: &mut dyn Write, azimuth_deg: f64, sigma_deg: f64) -> io::Result<()> {
        let sigma = self.unit.sigma(sigma_deg);
        self.angles_deg(azimuth_deg)
            .try_for_each(|(name, angle_deg)| writeln!(out, "{name:<10} {} ± {sigma}", self.unit.azimuth(angle_deg)))
    }

    /// The same for programs; `None` where degrees from true north are all that was asked for.
    pub fn asked(&self, azimuth_deg: f64, sigma_deg: f64) -> Option<Asked> {
        let Self { unit, convergence, target } = *self;
        if (unit, convergence, target) == (AngleUnit::Deg, None, None) {
            return None;
        }
        let of = |wanted: &str| {
            let (_, angle_deg) = self.angles_deg(azimuth_deg).find(|(name, _)| *name == wanted)?;
            let angle_deg = wrap_360_deg(angle_deg);
            Some(unit.written(angle_deg, unit.azimuth(angle_deg)))
        };
        Some(Asked {
            unit: unit.name(),
            convergence,
            target,
            sigma: unit.written(sigma_deg, unit.sigma(sigma_deg)),
            azimuth: of("azimuth")?,
            grid_azimuth: of("grid"),
            target_azimuth: of("target"),
            target_grid_azimuth: of("target grid"),
        })
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

    /// 40° are 44.444… gon, 38.5° are 42.777…; 0.036° are 0.04 gon.
    #[test]
    fn programs_get_what_was_asked_for() {
        let directions = Directions { unit: AngleUnit::Gon, convergence: Some(1.5), target: None };
        let asked = directions.asked(40.0, 0.036).unwrap();
        let gon = |written: &Written| match written {
            Written::Number(gon) => *gon,
            Written::Text(text) => panic!("{text}"),
        };
        assert!((gon(&asked.azimuth) - 400.0 / 9.0).abs() < 1e-12 && (gon(&asked.sigma) - 0.04).abs() < 1e-12);
        assert!((gon(asked.grid_azimuth.as_ref().unwrap()) - 385.0 / 9.0).abs() < 1e-12);
        assert_eq!((asked.unit, asked.convergence, asked.target_azimuth), ("gon", Some(1.5), None));
        let dms = Directions { unit: AngleUnit::Dms, convergence: None, target: None };
        assert_eq!(dms.asked(39.97404, 0.0415).unwrap().azimuth, Written::Text("39°58'26.5\"".into()));
        assert_eq!(Directions::default().asked(40.0, 0.04), None);
    }
}

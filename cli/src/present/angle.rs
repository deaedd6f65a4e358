//! Azimuths as their users write them: degrees, gon, mils or degrees-minutes-seconds, from grid north, and to a target.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use north_finder::units::wrap_360_deg;
use schemars::JsonSchema;
use serde::Serialize;

/// How an angle is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
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
    /// Units in a turn, the decimals that make about a third of an arcsecond, and the sign of the unit; `None` where it is not written as one number.
    fn decimal(self) -> Option<(f64, usize, &'static str)> {
        match self {
            Self::Deg => Some((360.0, 4, "°")),
            Self::Gon => Some((400.0, 4, " gon")),
            Self::Mil => Some((6400.0, 3, " mil")),
            Self::Dms => None,
        }
    }

    /// An azimuth in [0, one turn), rounded to about a third of an arcsecond.
    pub fn azimuth(self, azimuth_deg: f64) -> String {
        let Some((per_turn, decimals, unit)) = self.decimal() else {
            return dms((wrap_360_deg(azimuth_deg) * 36_000.0).round() as u64 % (360 * 36_000));
        };
        let text = format!("{:.decimals$}", wrap_360_deg(azimuth_deg) / 360.0 * per_turn);
        // What rounds up to a full turn is nothing.
        let full = format!("{per_turn:.decimals$}");
        format!("{}{unit}", if text == full { format!("{:.decimals$}", 0.0) } else { text })
    }

    /// A standard deviation, 0 or more.
    pub fn sigma(self, sigma_deg: f64) -> String {
        match self.decimal() {
            Some((per_turn, decimals, unit)) => format!("{:.decimals$}{unit}", sigma_deg / 360.0 * per_turn),
            None => dms((sigma_deg * 36_000.0).round() as u64),
        }
    }

    /// An angle for programs: all digits of a number, or `text` where the unit has none.
    fn written(self, angle_deg: f64, text: fn(Self, f64) -> String) -> Written {
        match self.decimal() {
            // Not a product and a quotient of the same number: all digits.
            Some((360.0, ..)) => Written::Number(angle_deg),
            Some((per_turn, ..)) => Written::Number(angle_deg / 360.0 * per_turn),
            None => Written::Text(text(self, angle_deg)),
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
    /// Of the angles here.
    pub unit: AngleUnit,
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

    /// From the grid, to the target, and both, where they were asked for, degrees.
    fn others_deg(&self, azimuth_deg: f64) -> [Option<f64>; 3] {
        let grid = |from_deg: f64| self.convergence.map(|convergence_deg| from_deg - convergence_deg);
        let target_deg = self.target.map(|target_deg| azimuth_deg + target_deg);
        [grid(azimuth_deg), target_deg, target_deg.and_then(grid)]
    }

    /// The azimuth with its sigma, and what else was asked for, a line each.
    pub fn write(&self, out: &mut dyn Write, azimuth_deg: f64, sigma_deg: f64) -> io::Result<()> {
        let sigma = self.unit.sigma(sigma_deg);
        self.said_deg(azimuth_deg)
            .try_for_each(|(name, angle_deg)| writeln!(out, "{name:<10} {} ± {sigma}", self.unit.azimuth(angle_deg)))
    }

    /// The azimuth and what else was asked for, degrees, by their names.
    pub fn said_deg(&self, azimuth_deg: f64) -> impl Iterator<Item = (&'static str, f64)> {
        let [grid, target, target_grid] = self.others_deg(azimuth_deg);
        let all = [("azimuth", Some(azimuth_deg)), ("grid", grid), ("target", target), ("target grid", target_grid)];
        all.into_iter().filter_map(|(name, angle_deg)| Some((name, angle_deg?)))
    }

    /// The true azimuth of the target, where one was asked for, degrees.
    pub fn target_azimuth_deg(&self, azimuth_deg: f64) -> Option<f64> {
        self.others_deg(azimuth_deg)[1]
    }

    /// The same for programs; `None` where degrees from true north are all that was asked for.
    pub fn asked(&self, azimuth_deg: f64, sigma_deg: f64) -> Option<Asked> {
        let Self { unit, convergence, target } = *self;
        if (unit, convergence, target) == (AngleUnit::Deg, None, None) {
            return None;
        }
        let azimuth = |angle_deg: f64| unit.written(wrap_360_deg(angle_deg), AngleUnit::azimuth);
        let [grid, to_target, target_grid] = self.others_deg(azimuth_deg).map(|angle_deg| angle_deg.map(azimuth));
        Some(Asked {
            unit,
            convergence,
            target,
            sigma: unit.written(sigma_deg, AngleUnit::sigma),
            azimuth: azimuth(azimuth_deg),
            grid_azimuth: grid,
            target_azimuth: to_target,
            target_grid_azimuth: target_grid,
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
        assert_eq!((asked.unit, asked.convergence, asked.target_azimuth), (AngleUnit::Gon, Some(1.5), None));
        let dms = Directions { unit: AngleUnit::Dms, convergence: None, target: None };
        assert_eq!(dms.asked(39.97404, 0.0415).unwrap().azimuth, Written::Text("39°58'26.5\"".into()));
        assert_eq!(Directions::default().asked(40.0, 0.04), None);
    }
}

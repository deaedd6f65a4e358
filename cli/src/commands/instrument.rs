//! The options that choose and change the simulated instrument: shared by `find`, `simulate` and `board`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use hal_sim::Scenario;
use north_finder::sequence::order::Order;
use north_finder::settings::Settings;

use super::{number, seed};
use crate::failure::Failure;
use crate::model_file::ModelFile;
use crate::settings_file::{read_settings, scenario_settings};

/// Which simulated instrument, where, and how it is set.
#[derive(Args, Clone, Debug, Default)]
pub struct InstrumentOptions {
    /// A built-in scenario ("north scenarios" lists them) or a scenario file ending in .toml
    #[arg(long, value_name = "NAME", default_value = "calm-bench")]
    pub scenario: String,
    /// Seed of everything random; the same scenario and seed give the same run
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = seed)]
    pub seed: u64,
    /// Latitude of the instrument and in its settings, degrees, north positive, -90 to 90
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-90, 90>)]
    pub latitude: Option<f64>,
    /// Turn the instrument: azimuth of its mark, degrees clockwise from true north, -360 to 360
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-360, 360>)]
    pub azimuth: Option<f64>,
    /// Order of the index positions; adaptive unless settings say otherwise
    #[arg(long, value_enum)]
    pub order: Option<OrderName>,
    /// One sigma of the azimuth that ends an adaptive fix, degrees, 0.001 to 10; it may take half an hour
    #[arg(long, value_name = "DEG", conflicts_with = "order", value_parser = accuracy)]
    pub accuracy: Option<f64>,
    /// Measuring time at each position, seconds, 2 to 3600, of an order that is not adaptive
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u16).range(2..=3600))]
    pub dwell: Option<u16>,
    /// Settings of the firmware, laid over the scenario's
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// Error model of the gyro, from a calibration
    #[arg(long, value_name = "M.toml")]
    pub model: Option<PathBuf>,
}

/// The built-in orders of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OrderName {
    /// 0, 90, 180, 270 degrees
    Plain,
    /// 90, 180, 270, 360 degrees
    Source,
    /// 0, 90, 180, 270, 270, 180, 90, 0 degrees: a linear drift cancels
    Mirrored,
    /// four short positions, then where the axis points east, west, west, east
    EastWest,
    /// two short positions, then where the axis points east and west, until sigma is small enough
    Adaptive,
    /// continuous rotation, 20 times to or fro: for a gyro whose bias wanders
    Rotation,
}

/// Longest fix that `--accuracy` allows, s: half an hour.
pub const LONGEST_S: f64 = 1800.0;

/// The power stays on so long after the time limit of a fix, s.
pub const SPARE_S: f64 = 60.0;

/// A sigma that an adaptive fix can be asked for, degrees.
pub fn accuracy(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.001..=10.0).contains(&value) => Ok(value),
        _ => Err("allowed is a number from 0.001 to 10".into()),
    }
}

impl OrderName {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Source => "source",
            Self::Mirrored => "mirrored",
            Self::EastWest => "east-west",
            Self::Adaptive => "adaptive",
            Self::Rotation => "rotation",
        }
    }
}

impl From<OrderName> for Order {
    fn from(name: OrderName) -> Self {
        match name {
            OrderName::Plain => Self::Plain,
            OrderName::Source => Self::Source,
            OrderName::Mirrored => Self::Mirrored,
            OrderName::EastWest => Self::EastWest,
            OrderName::Adaptive => Self::ADAPTIVE,
            OrderName::Rotation => Self::ROTATION,
        }
    }
}

impl InstrumentOptions {
    /// The file of the scenario, where it is not a built-in one.
    fn scenario_file(&self) -> Option<&Path> {
        self.scenario.ends_with(".toml").then(|| Path::new(&self.scenario))
    }

    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.scenario_file().into_iter().chain(self.settings.as_deref()).chain(self.model.as_deref())
    }

    /// The scenario with what the options change in it, and the settings for it.
    pub fn resolve(&self) -> Result<(Scenario, Settings), Failure> {
        let file = self.scenario_file();
        let mut scenario = match file {
            Some(path) => Scenario::load(path)?,
            None => Scenario::named(&self.scenario)?,
        };
        let mut settings = scenario_settings(&scenario, file)?;
        if let Some(path) = &self.settings {
            settings = read_settings(path, &settings)?;
        }
        if let Some(latitude_deg) = self.latitude {
            scenario.site.latitude_deg = latitude_deg;
            settings.latitude_deg = latitude_deg;
        }
        if let Some(azimuth_deg) = self.azimuth {
            scenario.site.azimuth_deg = azimuth_deg;
        }
        if let Some(order) = self.order {
            settings.sequence.order = order.into();
        }
        if let Some(accuracy_deg) = self.accuracy {
            settings.sequence.order = Order::Adaptive { accuracy_deg };
            settings.time_limit_s = settings.time_limit_s.max(LONGEST_S);
        }
        if let Some(dwell_s) = self.dwell {
            let orders = match settings.sequence.order {
                Order::Adaptive { .. } => Some(
                    "the adaptive order has no dwells of a fixed time; name another with --order, or --accuracy alone",
                ),
                Order::Rotation { .. } => Some("a continuous rotation has no dwells; name another order with --order"),
                _ => None,
            };
            if let Some(orders) = orders {
                return Err(Failure::Usage(format!("--dwell {dwell_s}: {orders}")));
            }
            settings.sequence.dwell_s = dwell_s;
        }
        // Waiting and turning take their time beside the dwells.
        settings.time_limit_s = settings.time_limit_s.max(2.0 * settings.sequence.measuring_s(&settings.index));
        scenario.duration_limit_s = scenario.duration_limit_s.max(settings.time_limit_s + SPARE_S);
        if let Some(path) = &self.model {
            ModelFile::read(path)?.apply_to_board(&mut settings)?;
        }
        Ok((scenario, settings))
    }
}

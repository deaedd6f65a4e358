//! `north bench gyros`: what a gyro gives, by its random walk, its instability and the latitude.

use std::io::Write;

use clap::Args;
use hal_sim::Scenario;
use north::commands::instrument::accuracy;
use north::failure::Failure;
use north::progress;
use north::settings_file::{declare_noise, scenario_settings};
use serde::Serialize;

use super::fixes::{Ended, Found, fix};
use super::{Bench, trials};
use crate::statistics::rms;

/// Angle random walk, °/√h, and bias instability, °/h: from a navigation gyro to an industrial one. The fourth is a KVH 1750 by its data sheet.
const GYROS: [(f64, f64); 6] =
    [(0.0005, 0.0005), (0.0015, 0.002), (0.004, 0.01), (0.012, 0.05), (0.03, 0.1), (0.1, 0.5)];
const LATITUDES_DEG: [f64; 5] = [0.0, 35.0, 50.0, 60.0, 70.0];
/// Headings of successive fixes, as shares of the circle: the golden ratio fills it evenly.
const OF_HEADING: f64 = 0.618_033_988_749_895;
/// What a base at rest and a bias that is calibrated may differ by beside the instability, °/h: the default of `gyro.bias_limit_deg_h`.
const BIAS_LIMIT_DEG_H: f64 = 1.0;

/// Sigma and time of a fix by the gyro and the latitude: adaptive order, on a calm bench, at headings all around
///
/// Whole fixes of the firmware's state machine, in this process. The gyro's noise is declared in the settings, as north characterise would print it.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench gyros --fixes 20 --time-limit 1800")]
pub struct Gyros {
    /// Fixes for each line
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    fixes: u64,
    /// A fix ends at this sigma of its azimuth, °
    #[arg(long, value_name = "DEG", default_value_t = 0.04, value_parser = accuracy)]
    accuracy: f64,
    /// or after so long with the sigma that it has, s
    #[arg(long, value_name = "S", default_value_t = 600, value_parser = clap::value_parser!(u32).range(60..=36_000))]
    time_limit: u32,
    /// Seed of the first fix
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One gyro at one latitude.
#[derive(Serialize)]
pub struct Row {
    arw_deg_per_sqrt_h: f64,
    bias_instability_deg_h: f64,
    latitude_deg: f64,
    fixes: usize,
    azimuths: usize,
    /// Means of the azimuths' own sigmas, and of the time from power-up.
    sigma_deg: Option<f64>,
    elapsed_s: Option<f64>,
    rms_error_deg: Option<f64>,
    /// Fixes without an azimuth, by their faults.
    refused: Vec<&'static str>,
}

impl Bench for Gyros {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar((GYROS.len() * LATITUDES_DEG.len()) as u64 * self.fixes, "fixes");
        writeln!(
            out,
            "| N, °/√h | bias instability, °/h | latitude, ° | azimuths | sigma, ° | rms error, ° | time, s | refused |\n|---|---|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        for gyro in GYROS {
            for latitude_deg in LATITUDES_DEG {
                let fixes = trials(self.seed..self.seed + self.fixes, &bar, |seed| self.fix(gyro, latitude_deg, seed))?;
                let row = Row::new(gyro, latitude_deg, &fixes.into_iter().collect::<Result<Vec<_>, Failure>>()?);
                bar.suspend(|| row.write(out))?;
                rows.push(row);
            }
        }
        bar.finish_and_clear();
        write_by_latitude(out, &rows)?;
        Ok(rows)
    }
}

/// Sigma and time of every gyro, one latitude beside the other.
fn write_by_latitude(out: &mut dyn Write, rows: &[Row]) -> std::io::Result<()> {
    let latitudes = LATITUDES_DEG.map(|latitude_deg| format!(" {latitude_deg}° |")).concat();
    writeln!(out, "\n| N, °/√h | bias instability, °/h |{latitudes}\n|---|---|{}", "---|".repeat(LATITUDES_DEG.len()))?;
    rows.chunks(LATITUDES_DEG.len()).try_for_each(|of_gyro| {
        let fixes = |row: &Row| match (row.sigma_deg, row.elapsed_s) {
            (Some(sigma_deg), Some(elapsed_s)) => format!(" {sigma_deg:.3}° in {elapsed_s:.0} s |"),
            _ => " – |".into(),
        };
        let Row { arw_deg_per_sqrt_h, bias_instability_deg_h, .. } = of_gyro[0];
        let all: String = of_gyro.iter().map(fixes).collect();
        writeln!(out, "| {arw_deg_per_sqrt_h} | {bias_instability_deg_h} |{all}")
    })
}

impl Gyros {
    fn fix(&self, (arw, instability): (f64, f64), latitude_deg: f64, seed: u64) -> Result<Ended, Failure> {
        let mut scenario = Scenario::named("calm-bench")?;
        scenario.site.latitude_deg = latitude_deg;
        scenario.site.azimuth_deg = 360.0 * (OF_HEADING * seed as f64).fract();
        scenario.gyro.arw_deg_per_sqrt_h = arw;
        scenario.gyro.bias_instability_deg_h = instability;
        scenario.duration_limit_s = f64::from(self.time_limit) + 600.0;
        let mut settings = scenario_settings(&scenario, None)?;
        settings.gyro.bias_instability_deg_h = instability;
        settings.gyro.bias_limit_deg_h = BIAS_LIMIT_DEG_H.max(4.0 * instability);
        settings.time_limit_s = self.time_limit.into();
        settings.sequence.order = north_finder::sequence::order::Order::Adaptive { accuracy_deg: self.accuracy };
        declare_noise(&mut settings, arw);
        fix(scenario, seed, settings)
    }
}

impl Row {
    fn new((arw, instability): (f64, f64), latitude_deg: f64, fixes: &[Ended]) -> Self {
        let found: Vec<(&Ended, &Found)> =
            fixes.iter().filter_map(|ended| Some((ended, ended.end.as_ref().ok()?))).collect();
        let mean = |value: &dyn Fn(&(&Ended, &Found)) -> f64| {
            (!found.is_empty()).then(|| found.iter().map(value).sum::<f64>() / found.len() as f64)
        };
        let faults = fixes.iter().filter_map(|ended| ended.end.as_ref().err());
        Self {
            arw_deg_per_sqrt_h: arw,
            bias_instability_deg_h: instability,
            latitude_deg,
            fixes: fixes.len(),
            azimuths: found.len(),
            sigma_deg: mean(&|(_, found)| found.fix.sigma_deg),
            elapsed_s: mean(&|(ended, _)| ended.elapsed_s),
            rms_error_deg: (!found.is_empty()).then(|| rms(found.iter().map(|(_, found)| found.error_deg))),
            refused: faults.map(|fault| fault.map_or("no end in time", |fault| fault.name())).collect(),
        }
    }

    fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let number =
            |value: Option<f64>, digits: usize| value.map_or("–".into(), |value| format!("{value:.digits$}"));
        let mut refused = self.refused.clone();
        refused.sort_unstable();
        refused.dedup();
        writeln!(
            out,
            "| {} | {} | {} | {} of {} | {} | {} | {} | {} |",
            self.arw_deg_per_sqrt_h,
            self.bias_instability_deg_h,
            self.latitude_deg,
            self.azimuths,
            self.fixes,
            number(self.sigma_deg, 3),
            number(self.rms_error_deg, 3),
            number(self.elapsed_s, 0),
            if refused.is_empty() { "–".into() } else { refused.join(", ") }
        )
    }
}

//! `north bench adaptive`: what an adaptive fix makes of its time.

use std::io::Write;

use clap::Args;
use hal_sim::Scenario;
use north::commands::instrument::{LONGEST_S, SPARE_S};
use north::failure::Failure;
use north::progress;
use north::settings_file::scenario_settings;
use north_finder::earth::earth_rate;
use north_finder::sequence::order::Order;
use serde::Serialize;

use super::fixes::fix;
use super::{Bench, trials};
use crate::statistics::{rms, rms_interval};

/// Times that are given, s, and the least share of the limit that is promised for it.
const TIMES: [(f64, Option<f64>); 5] =
    [(60.0, Some(0.7)), (120.0, None), (240.0, Some(0.9)), (480.0, None), (960.0, None)];
/// Sigmas that are asked for, degrees.
const ACCURACIES_DEG: [f64; 4] = [0.1, 0.06, 0.04, 0.03];
/// No fix reaches it: the time limit ends it.
const NEVER_DEG: f64 = 0.001;

/// Adaptive fixes against 60·N/(h√T), the limit for their whole elapsed time T: all of it spent with the axis pointing east and west
///
/// Whole fixes of the firmware's state machine, from the command to the azimuth: levelling, gates and moves included. Headings all around the
/// circle.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north bench adaptive --fixes 400\n  north bench adaptive --fixes 2000 --time 60 --time 240"
)]
pub struct Adaptive {
    /// Fixes for each line
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(10..=100_000))]
    fixes: u64,
    /// The simulated instrument and its place
    #[arg(long, value_name = "NAME", default_value = "calm-bench")]
    scenario: String,
    /// Only the lines of white noise with these time limits, s
    #[arg(long, value_name = "S", value_parser = time)]
    time: Vec<f64>,
    /// Seed of the first fix
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// A time that there is a line for.
fn time(text: &str) -> Result<f64, String> {
    let known = TIMES.map(|(time_s, _)| time_s);
    match text.parse() {
        Ok(time_s) if known.contains(&time_s) => Ok(time_s),
        _ => Err(format!("allowed are {known:?}")),
    }
}

/// What a line is measured with.
struct Case {
    noise_only: bool,
    time_limit_s: f64,
    accuracy_deg: f64,
    promised: Option<f64>,
}

/// A line of the table.
#[derive(Serialize)]
pub struct Row {
    /// Nothing but the gyro's white noise acts: no error of the encoder, no wandering bias, no bias of the accelerometers.
    noise_only: bool,
    time_limit_s: f64,
    accuracy_deg: f64,
    fixes: usize,
    refused: usize,
    elapsed_mean_s: f64,
    accuracy_rms_deg: f64,
    accuracy_interval_deg: Option<[f64; 2]>,
    sigma_mean_deg: f64,
    error_over_sigma_rms: f64,
    /// The limit for the elapsed time of every fix, rms.
    limit_deg: f64,
    /// The limit over the rms of the errors, and its 95 % interval.
    share: f64,
    share_interval: Option<[f64; 2]>,
    promised: Option<f64>,
}

impl Bench for Adaptive {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let timed = |noise_only: bool| {
            TIMES.map(|(time_limit_s, promised)| Case {
                noise_only,
                time_limit_s,
                accuracy_deg: NEVER_DEG,
                promised: promised.filter(|_| noise_only),
            })
        };
        let asked = ACCURACIES_DEG.map(|accuracy_deg| Case {
            noise_only: false,
            time_limit_s: LONGEST_S,
            accuracy_deg,
            promised: None,
        });
        let mut cases: Vec<Case> = timed(true).into_iter().chain(timed(false)).chain(asked).collect();
        if !self.time.is_empty() {
            cases.retain(|case| case.noise_only && self.time.contains(&case.time_limit_s));
        }
        let bar = progress::bar(cases.len() as u64 * self.fixes, "fixes");
        writeln!(out, "{}, {} fixes a line, seed {}\n", self.scenario, self.fixes, self.seed)?;
        writeln!(
            out,
            "| errors | time limit, s | sigma asked for, ° | refused | elapsed, s | error rms, ° (95 %) | sigma, ° | error / sigma | limit, ° | share of the limit (95 %) |\n|---|---|---|---|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        for case in &cases {
            let row = self.row(case, &bar)?;
            bar.suspend(|| row.write(out))?;
            rows.push(row);
        }
        bar.finish_and_clear();
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        // Under white noise every fix has an azimuth: refusals keep no promise, nor does a share that is not a number.
        let is_missed = |row: &&Row| row.promised.is_some_and(|promised| row.refused > 0 || !(row.share >= promised));
        let of_row =
            |row: &Row| format!("{:.3} of the limit at {} s, {} refused", row.share, row.time_limit_s, row.refused);
        let missed: Vec<String> = rows.iter().filter(is_missed).map(of_row).collect();
        if missed.is_empty() { Ok(()) } else { Err(Failure::Refused(missed.join("; "))) }
    }
}

impl Adaptive {
    fn row(&self, case: &Case, bar: &indicatif::ProgressBar) -> Result<Row, Failure> {
        let Case { noise_only, time_limit_s, accuracy_deg, promised } = *case;
        let mut scenario = Scenario::named(&self.scenario)?;
        scenario.duration_limit_s = time_limit_s + SPARE_S;
        if noise_only {
            scenario.encoder.eccentricity_deg = 0.0;
            scenario.accelerometer.bias_mg = [0.0; 3];
            (scenario.gyro.bias_instability_deg_h, scenario.gyro.rrw_deg_h_per_sqrt_h) = (0.0, 0.0);
        }
        let mut settings = scenario_settings(&scenario, None)?;
        settings.sequence.order = Order::Adaptive { accuracy_deg };
        settings.time_limit_s = time_limit_s;
        let noise = settings.gyro.arw_deg_per_sqrt_h;
        let earth = earth_rate(settings.latitude_deg)
            .map_err(|error| Failure::Refused(format!("{}: {error}", self.scenario)))?;
        let limit_deg = |elapsed_s: f64| (60.0 * noise / (earth.north_deg_h * elapsed_s.sqrt())).to_degrees();
        let ended = trials(0..self.fixes, bar, |number| {
            let mut scenario = scenario.clone();
            scenario.site.azimuth_deg = 360.0 * number as f64 / self.fixes as f64;
            fix(scenario, self.seed + number, settings.clone())
        })?;
        let ended = ended.into_iter().collect::<Result<Vec<_>, Failure>>()?;
        let found: Vec<_> =
            ended.iter().filter_map(|ended| Some((ended.elapsed_s, ended.end.as_ref().ok()?))).collect();
        let mean = |value: &dyn Fn(f64, &super::fixes::Found) -> f64| {
            found.iter().map(|(elapsed_s, found)| value(*elapsed_s, found)).sum::<f64>() / found.len() as f64
        };
        let accuracy_rms_deg = rms(found.iter().map(|(_, found)| found.error_deg));
        let limit_deg = rms(found.iter().map(|(elapsed_s, _)| limit_deg(*elapsed_s)));
        let accuracy_interval_deg = rms_interval(accuracy_rms_deg, found.len());
        Ok(Row {
            noise_only,
            time_limit_s,
            accuracy_deg,
            fixes: ended.len(),
            refused: ended.len() - found.len(),
            elapsed_mean_s: mean(&|elapsed_s, _| elapsed_s),
            accuracy_rms_deg,
            accuracy_interval_deg,
            sigma_mean_deg: mean(&|_, found| found.fix.sigma_deg),
            error_over_sigma_rms: rms(found.iter().map(|(_, found)| found.error_deg / found.fix.sigma_deg)),
            limit_deg,
            share: limit_deg / accuracy_rms_deg,
            share_interval: accuracy_interval_deg.map(|[low, high]| [limit_deg / high, limit_deg / low]),
            promised,
        })
    }
}

impl Row {
    fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let interval = |of: Option<[f64; 2]>| of.map_or("–".into(), |[low, high]| format!("{low:.3} … {high:.3}"));
        let accuracy = if self.accuracy_deg > NEVER_DEG { self.accuracy_deg.to_string() } else { "–".into() };
        writeln!(
            out,
            "| {} | {} | {accuracy} | {} | {:.0} | {:.4} ({}) | {:.4} | {:.2} | {:.4} | {:.3} ({}) |",
            if self.noise_only { "white noise" } else { "all" },
            self.time_limit_s,
            self.refused,
            self.elapsed_mean_s,
            self.accuracy_rms_deg,
            interval(self.accuracy_interval_deg),
            self.sigma_mean_deg,
            self.error_over_sigma_rms,
            self.limit_deg,
            self.share,
            interval(self.share_interval),
        )
    }
}

//! `north bench gates`: what both gates of the source are worth.

use std::collections::BTreeMap;
use std::io::{self, Write};

use clap::{Args, ValueEnum};
use hal_sim::Scenario;
use north::commands::instrument::OrderName;
use north::failure::Failure;
use north::progress;
use north::settings_file::scenario_settings;
use north_finder::settings::Settings;
use serde::Serialize;

use super::fixes::{Ended, fix};
use super::{Bench, trials};
use crate::statistics::{rms, rms_interval};

/// Scenarios in which a gate has something to do, and one in which it has not.
const SCENARIOS: [&str; 6] =
    ["calm-bench", "disturbed-start", "jittery-drive", "shocks-during-dwell", "windy-tripod", "vehicle"];
/// A threshold that no second exceeds, °/h; the settings demand that it lies below the gyro's range.
const OPEN_DEG_H: f64 = 3000.0;

/// The disturbance gate and the jitter gate, each on and off, in every order of positions
///
/// Whole fixes of the firmware's state machine, in this process. A gate that is off lets the first second pass.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north bench gates --fixes 20\n  north bench gates --scenario jittery-drive --order adaptive"
)]
pub struct Gates {
    /// Fixes for each line
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    fixes: u64,
    /// Only this scenario
    #[arg(long, value_name = "NAME")]
    scenario: Option<String>,
    /// Only these orders
    #[arg(long, value_enum)]
    order: Vec<OrderName>,
    /// Seed of the first fix; each line has the same seeds
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One scenario in one order with the gates on or off.
#[derive(Serialize)]
pub struct Row {
    scenario: String,
    order: &'static str,
    disturbance_gate: bool,
    jitter_gate: bool,
    fixes: u64,
    /// Fixes with an azimuth.
    azimuths: usize,
    rms_deg: Option<f64>,
    /// 95 % interval by chi-square.
    rms_interval_deg: Option<[f64; 2]>,
    elapsed_mean_s: Option<f64>,
    /// Fixes with each flag.
    flags: BTreeMap<&'static str, usize>,
    /// Fixes refused, by fault.
    refused: BTreeMap<&'static str, usize>,
}

impl Bench for Gates {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let scenarios = self.scenario.as_deref().map_or(SCENARIOS.to_vec(), |name| vec![name]);
        let orders = if self.order.is_empty() { OrderName::value_variants() } else { &self.order };
        let bar = progress::bar((scenarios.len() * orders.len()) as u64 * 4 * self.fixes, "fixes");
        writeln!(
            out,
            "| scenario | order | disturbance gate | jitter gate | azimuths | rms error, ° | 95 % | elapsed, s | flags, fixes \
             | refused |\n|---|---|---|---|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        for name in scenarios {
            let scenario = Scenario::named(name)?;
            let settings = scenario_settings(&scenario, None)?;
            for order in orders {
                for gates in [[true, true], [true, false], [false, true], [false, false]] {
                    let settings = gated(&settings, *order, gates);
                    let fixes = trials(self.seed..self.seed + self.fixes, &bar, |seed| {
                        fix(scenario.clone(), seed, settings.clone())
                    })?;
                    let fixes = fixes.into_iter().collect::<Result<Vec<_>, Failure>>()?;
                    let row = Row::new(name, *order, gates, &fixes);
                    bar.suspend(|| write_row(out, &row))?;
                    rows.push(row);
                }
            }
        }
        bar.finish_and_clear();
        Ok(rows)
    }
}

/// The settings with the disturbance gate and the jitter gate on or off.
fn gated(settings: &Settings, order: OrderName, [disturbance, jitter]: [bool; 2]) -> Settings {
    let mut settings = settings.clone();
    settings.sequence.order = order.into();
    for (gate, on) in [(&mut settings.disturbance, disturbance), (&mut settings.jitter, jitter)] {
        if !on {
            gate.threshold_deg_h = OPEN_DEG_H;
            gate.seconds = 1;
        }
    }
    settings
}

impl Row {
    fn new(scenario: &str, order: OrderName, [disturbance_gate, jitter_gate]: [bool; 2], fixes: &[Ended]) -> Self {
        let (mut flags, mut refused) = (BTreeMap::new(), BTreeMap::new());
        let (mut errors_deg, mut elapsed_s) = (Vec::new(), 0.0);
        for ended in fixes {
            match &ended.end {
                Ok(found) => {
                    errors_deg.push(found.error_deg);
                    elapsed_s += ended.elapsed_s;
                    found.fix.flags.iter().for_each(|flag| *flags.entry(flag.name()).or_default() += 1);
                }
                Err(fault) => {
                    *refused.entry(fault.map_or("no end in time", |fault| fault.name())).or_default() += 1;
                }
            }
        }
        let azimuths = errors_deg.len();
        let rms_deg = (azimuths > 0).then(|| rms(errors_deg));
        Self {
            scenario: scenario.into(),
            order: order.name(),
            disturbance_gate,
            jitter_gate,
            fixes: fixes.len() as u64,
            azimuths,
            rms_deg,
            rms_interval_deg: rms_deg.and_then(|rms_deg| rms_interval(rms_deg, azimuths)),
            elapsed_mean_s: (azimuths > 0).then(|| elapsed_s / azimuths as f64),
            flags,
            refused,
        }
    }
}

fn write_row(out: &mut dyn Write, row: &Row) -> io::Result<()> {
    let on = |on: bool| if on { "on" } else { "off" };
    let number = |value: Option<f64>, digits: usize| value.map_or("–".into(), |value| format!("{value:.digits$}"));
    let interval = row.rms_interval_deg.map_or("–".into(), |[low, high]| format!("{low:.3} … {high:.3}"));
    let counts = |counts: &BTreeMap<&str, usize>| {
        let counts: Vec<_> = counts.iter().map(|(name, count)| format!("{name} {count}")).collect();
        if counts.is_empty() { "–".into() } else { counts.join(", ") }
    };
    writeln!(
        out,
        "| {} | {} | {} | {} | {} of {} | {} | {interval} | {} | {} | {} |",
        row.scenario,
        row.order,
        on(row.disturbance_gate),
        on(row.jitter_gate),
        row.azimuths,
        row.fixes,
        number(row.rms_deg, 4),
        number(row.elapsed_mean_s, 0),
        counts(&row.flags),
        counts(&row.refused),
    )
}

//! `north bench accuracy`: azimuth errors of thousands of simulated fixes against the theoretical bound.

use std::io::{self, Write};

use clap::Args;
use indicatif::ProgressBar;
use serde::Serialize;

use super::{Bench, trials};
use crate::accuracy::{Case, EVEN_S, Noise, Order, REVERSAL_S, Spread, Statistics, confidence_95, run};
use north::failure::Failure;
use north::progress;

/// Azimuth error against the bound 60√2·N/(h√T), by Monte Carlo on all cores
///
/// Simulated one-second rates of an independent world go through the firmware's replay, with random headings and biases.
/// Tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench accuracy --trials 4000 --json accuracy.json")]
pub struct Accuracy {
    /// Trials for each row of the tables, 10 to 1000000
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u64).range(10..=1_000_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Duration of the mirrored order with dwells of 30 s.
const ELAPSED_S: f64 = 294.0;

/// A table of the result.
struct Table {
    name: &'static str,
    title: &'static str,
    rows: Vec<Spread>,
}

/// One row of one table.
#[derive(Serialize)]
pub struct Row {
    table: &'static str,
    order: &'static str,
    /// How often a continuous rotation passes its travel.
    passes: Option<u16>,
    noise: String,
    /// `None`: drawn anew for every trial.
    arw_deg_per_sqrt_h: Option<f64>,
    dwell_s: Option<f64>,
    latitude_deg: Option<f64>,
    drift_deg_h_per_h: f64,
    #[serde(flatten)]
    statistics: Statistics,
}

impl Bench for Accuracy {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let tables = tables();
        let count: usize = tables.iter().map(|table| table.rows.len()).sum();
        let bar = progress::bar(count as u64 * self.trials, "trials");
        let mut all = Vec::new();
        write_preamble(out, self.trials)?;
        for table in &tables {
            // Every row has random numbers of its own: the rows are independent of each other.
            let rows = (all.len() as u64..).zip(&table.rows);
            let rows = rows
                .map(|(number, spread)| self.row(table.name, spread, number << 32, &bar))
                .collect::<Result<Vec<_>, Failure>>()?;
            bar.suspend(|| write_table(out, table, &rows))?;
            all.extend(rows);
        }
        bar.finish_and_clear();
        Ok(all)
    }
}

impl Accuracy {
    fn row(&self, table: &'static str, spread: &Spread, first: u64, bar: &ProgressBar) -> Result<Row, Failure> {
        let trials = trials(first..first + self.trials, bar, |number| run(spread, self.seed, number).ok())?;
        let good: Vec<_> = trials.iter().copied().flatten().collect();
        let statistics = Statistics::of(&good, trials.len() - good.len())
            .ok_or_else(|| Failure::Refused(format!("{table}: no trial gave an azimuth")))?;
        Ok(Row::new(table, spread, statistics))
    }
}

/// What is measured. Every trial draws its own heading and bias.
fn tables() -> Vec<Table> {
    let nominal = Case::NOMINAL;
    let one = Spread::One;
    let arw = [0.0005, 0.001, 0.005, 0.01, 0.02].map(|arw_deg_per_sqrt_h| one(Case { arw_deg_per_sqrt_h, ..nominal }));
    let dwell = [10.0, 60.0, 120.0].map(|dwell_s| one(Case { dwell_s, ..nominal }));
    let latitude = [-70.0, -45.0, 0.0, 60.0, 70.0].map(|latitude_deg| one(Case { latitude_deg, ..nominal }));
    let orders = [Order::Plain, Order::Source].map(|order| one(Case { order, ..nominal }));
    let all = [Order::Mirrored, Order::Plain].map(Spread::All);
    let drift = [Order::Plain, Order::Mirrored].into_iter().flat_map(|order| {
        [0.0, 1.0, 10.0]
            .map(|drift_deg_h_per_h| one(Case { order, drift_deg_h_per_h, declared_drift_deg_h_per_h: 0.1, ..nominal }))
    });
    let refinement = [0.0, 5.0].into_iter().flat_map(|drift_deg_h_per_h| {
        let declared_drift_deg_h_per_h = if drift_deg_h_per_h > 0.0 { 0.1 } else { 0.0 };
        [(Order::Mirrored, 30.0), (Order::EastWest, 50.0)].map(|(order, dwell_s)| {
            one(Case { order, dwell_s, drift_deg_h_per_h, declared_drift_deg_h_per_h, ..nominal })
        })
    });
    let noises = [
        Noise::White,
        Noise::HeavyTails,
        Noise::Bursts,
        Noise::Angle { arcsec: 0.5, declared: true },
        Noise::Angle { arcsec: 0.5, declared: false },
        Noise::Angle { arcsec: 0.05, declared: true },
        Noise::Angle { arcsec: 0.05, declared: false },
    ];
    vec![
        Table {
            name: "white-noise",
            title: "White noise",
            rows: [one(nominal)].into_iter().chain(orders).chain(arw).chain(dwell).chain(latitude).chain(all).collect(),
        },
        Table { name: "drift", title: "Linear drift of the bias", rows: drift.collect() },
        Table {
            name: "refinement",
            title: "East-west refinement, 240 s of measuring in all",
            rows: refinement.collect(),
        },
        Table {
            name: "noise",
            title: "Tails, and noise of the angle",
            rows: noises.map(|noise| one(Case { noise, ..nominal })).into(),
        },
        Table { name: "elapsed", title: "Orders at equal elapsed time, 294 s with their moves", rows: of_equal_time() },
    ]
}

/// Orders that take as long as the mirrored one with its six moves of 9 s, in white, flicker and drifting noise.
fn of_equal_time() -> Vec<Spread> {
    let rotation = (Order::Rotation { passes: (ELAPSED_S / (EVEN_S + REVERSAL_S)) as u16 }, EVEN_S);
    let orders = [(Order::Mirrored, 30.0), (Order::EastWest, 50.0), rotation];
    let noises = [(Noise::White, 0.0), (Noise::Flicker { instability_deg_h: 0.05 }, 0.0), (Noise::White, 5.0)];
    let of_noise = |(noise, drift_deg_h_per_h): (Noise, f64)| {
        orders.map(|(order, dwell_s)| {
            let declared_drift_deg_h_per_h = if drift_deg_h_per_h > 0.0 { 0.1 } else { 0.0 };
            let case = Case { order, dwell_s, noise, drift_deg_h_per_h, declared_drift_deg_h_per_h, ..Case::NOMINAL };
            Spread::One(case)
        })
    };
    noises.into_iter().flat_map(of_noise).collect()
}

impl Row {
    fn new(table: &'static str, spread: &Spread, statistics: Statistics) -> Self {
        let (case, order) = match spread {
            Spread::One(case) => (Some(case), case.order),
            Spread::All(order) => (None, *order),
        };
        Self {
            table,
            order: order.name(),
            passes: match order {
                Order::Rotation { passes } => Some(passes),
                _ => None,
            },
            noise: case.map_or(Noise::White, |case| case.noise).name(),
            arw_deg_per_sqrt_h: case.map(|case| case.arw_deg_per_sqrt_h),
            dwell_s: case.map(|case| case.dwell_s),
            latitude_deg: case.map(|case| case.latitude_deg),
            drift_deg_h_per_h: case.map_or(0.0, |case| case.drift_deg_h_per_h),
            statistics,
        }
    }
}

fn write_preamble(out: &mut dyn Write, trials: u64) -> io::Result<()> {
    let percent = 100.0 * confidence_95(trials as usize);
    writeln!(
        out,
        "Each row: {trials} simulated fixes with random headings. Bound: 60√2·N/(h√T), the least for equally spaced\n\
         positions. ± is the 95 % confidence interval: an rms of n errors has the relative standard deviation 1/√(2n), here\n\
         ±{percent:.1} %. \"Covered\": share of fixes whose azimuth ± 1.96 sigma holds the truth, 95 % if sigma is correct."
    )
}

fn write_table(out: &mut dyn Write, table: &Table, rows: &[Row]) -> io::Result<()> {
    writeln!(out, "\n### {}\n", table.title)?;
    writeln!(
        out,
        "| order | noise | N, °/√h | dwell, s | latitude, ° | drift, °/h per h | rms error, ° | bound, ° | rms / bound | covered, % \
         | flagged, % |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|---|---|---|---|---|")?;
    rows.iter().try_for_each(|row| write_row(out, row))
}

fn write_row(out: &mut dyn Write, row: &Row) -> io::Result<()> {
    let cell = |value: Option<f64>, range: &str| value.map_or_else(|| range.to_owned(), |value| value.to_string());
    let Statistics {
        rms_deg, bound_deg, ratio, ratio_confidence_95, coverage, coverage_confidence_95, flagged, ..
    } = row.statistics;
    writeln!(
        out,
        "| {}{} | {} | {} | {} | {} | {} | {rms_deg:.4} | {bound_deg:.4} | {ratio:.3} ± {ratio_confidence_95:.3} | {:.1} ± {:.1} \
         | {:.1} |",
        row.order,
        row.passes.map_or(String::new(), |passes| format!(", {passes} passes")),
        row.noise,
        cell(row.arw_deg_per_sqrt_h, "0.0005 … 0.02"),
        cell(row.dwell_s, "10 … 120"),
        cell(row.latitude_deg, "−70 … 70"),
        row.drift_deg_h_per_h,
        100.0 * coverage,
        100.0 * coverage_confidence_95,
        100.0 * flagged,
    )?;
    if row.statistics.refused > 0 {
        writeln!(out, "<!-- {} of these fixes were refused -->", row.statistics.refused)?;
    }
    Ok(())
}

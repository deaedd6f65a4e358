//! `north bench repeat`: the acceptance test of a north finder.

use std::collections::BTreeSet;
use std::io::{self, Write};

use clap::{Args, ValueEnum};
use hal_sim::Scenario;
use north::commands::instrument::OrderName;
use north::failure::Failure;
use north::progress;
use north::settings_file::scenario_settings;
use serde::Serialize;

use super::fixes::{Ended, fix};
use super::{Bench, trials};
use crate::statistics::{rms, rms_interval};

/// The acceptance test of a north finder: fixes repeated at headings around the circle, in every order of positions
///
/// One instrument is put up at each heading and finds north again and again. Repeatability is the standard deviation
/// about the mean of a heading; accuracy is the rms of all errors. Whole fixes of the firmware's state machine, in this
/// process.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench repeat\n  north bench repeat --scenario windy-tripod --fixes 20")]
pub struct Repeat {
    /// Headings, evenly around the circle
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u64).range(1..=360))]
    headings: u64,
    /// Fixes at each heading
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..=10_000))]
    fixes: u64,
    /// The simulated instrument and its place
    #[arg(long, value_name = "NAME", default_value = "calm-bench")]
    scenario: String,
    /// Seed of the first fix
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One line of one of the tables.
#[derive(Serialize)]
#[serde(tag = "table", rename_all = "kebab-case")]
pub enum Row {
    Order(OrderRow),
    Heading(HeadingRow),
}

/// All headings in one order.
#[derive(Clone, Serialize)]
pub struct OrderRow {
    order: &'static str,
    fixes: usize,
    refused: usize,
    flags: BTreeSet<&'static str>,
    elapsed_mean_s: f64,
    /// Standard deviation about the means of the headings, all headings together, with its 95 % interval.
    repeatability_deg: f64,
    repeatability_interval_deg: Option<[f64; 2]>,
    /// Greatest standard deviation of a heading.
    repeatability_worst_deg: f64,
    /// Root mean square of all errors, and the greatest.
    accuracy_rms_deg: f64,
    accuracy_interval_deg: Option<[f64; 2]>,
    error_most_deg: f64,
    /// Root mean square of error over the sigma that came with it.
    error_over_sigma_rms: f64,
    /// What repeating does not take out: least and greatest mean error of a heading.
    heading_error_deg: [f64; 2],
}

/// One heading in one order.
#[derive(Clone, Serialize)]
pub struct HeadingRow {
    order: &'static str,
    heading_deg: f64,
    mean_error_deg: f64,
    repeatability_deg: f64,
}

impl Bench for Repeat {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let scenario = Scenario::named(&self.scenario)?;
        let settings = scenario_settings(&scenario, None)?;
        let orders = OrderName::value_variants();
        let count = self.headings * self.fixes;
        let bar = progress::bar(orders.len() as u64 * count, "fixes");
        let mut summaries = Vec::new();
        let mut headings = Vec::new();
        for order in orders {
            let mut settings = settings.clone();
            settings.sequence.order = (*order).into();
            let fixes = trials(0..count, &bar, |number| {
                let mut scenario = scenario.clone();
                scenario.site.azimuth_deg = self.heading_deg(number / self.fixes);
                fix(scenario, self.seed + number, settings.clone())
            })?;
            let fixes = fixes.into_iter().collect::<Result<Vec<_>, Failure>>()?;
            let of_order: Vec<HeadingRow> = fixes
                .chunks(self.fixes as usize)
                .zip(0..)
                .filter_map(|(fixes, number)| HeadingRow::new(order.name(), self.heading_deg(number), fixes))
                .collect();
            summaries.push(
                OrderRow::new(order.name(), &fixes, &of_order).ok_or_else(|| {
                    Failure::Refused(format!("{}: {}: too few azimuths", self.scenario, order.name()))
                })?,
            );
            headings.push(of_order);
        }
        bar.finish_and_clear();
        writeln!(out, "{}, {} headings × {} fixes, seed {}\n", self.scenario, self.headings, self.fixes, self.seed)?;
        write_orders(out, &summaries)?;
        write_headings(out, &headings)?;
        Ok(summaries.into_iter().map(Row::Order).chain(headings.into_iter().flatten().map(Row::Heading)).collect())
    }
}

impl Repeat {
    fn heading_deg(&self, number: u64) -> f64 {
        360.0 * number as f64 / self.headings as f64
    }
}

fn errors_deg(fixes: &[Ended]) -> Vec<f64> {
    fixes.iter().filter_map(|ended| Some(ended.end.as_ref().ok()?.error_deg)).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

impl HeadingRow {
    /// `None` with fewer than two azimuths.
    fn new(order: &'static str, heading_deg: f64, fixes: &[Ended]) -> Option<Self> {
        let errors_deg = errors_deg(fixes);
        let mean_error_deg = mean(&errors_deg);
        let squares: f64 = errors_deg.iter().map(|error_deg| (error_deg - mean_error_deg).powi(2)).sum();
        let degrees_of_freedom = errors_deg.len().checked_sub(1).filter(|freedom| *freedom > 0)?;
        let repeatability_deg = (squares / degrees_of_freedom as f64).sqrt();
        Some(Self { order, heading_deg, mean_error_deg, repeatability_deg })
    }
}

impl OrderRow {
    fn new(order: &'static str, fixes: &[Ended], headings: &[HeadingRow]) -> Option<Self> {
        let errors_deg = errors_deg(fixes);
        let found = fixes.iter().filter_map(|ended| Some((ended.elapsed_s, ended.end.as_ref().ok()?)));
        let repeatability_deg = rms(headings.iter().map(|heading| heading.repeatability_deg));
        let accuracy_rms_deg = rms(errors_deg.iter().copied());
        let heading_errors = || headings.iter().map(|heading| heading.mean_error_deg);
        let degrees_of_freedom = errors_deg.len().checked_sub(headings.len())?;
        (!headings.is_empty()).then(|| Self {
            order,
            fixes: fixes.len(),
            refused: fixes.len() - errors_deg.len(),
            flags: found.clone().flat_map(|(_, found)| found.fix.flags.iter().map(|flag| flag.name())).collect(),
            elapsed_mean_s: mean(&found.clone().map(|(elapsed_s, _)| elapsed_s).collect::<Vec<_>>()),
            repeatability_deg,
            repeatability_interval_deg: rms_interval(repeatability_deg, degrees_of_freedom),
            repeatability_worst_deg: headings.iter().map(|heading| heading.repeatability_deg).fold(0.0, f64::max),
            accuracy_rms_deg,
            accuracy_interval_deg: rms_interval(accuracy_rms_deg, errors_deg.len()),
            error_most_deg: errors_deg.iter().map(|error_deg| error_deg.abs()).fold(0.0, f64::max),
            error_over_sigma_rms: rms(found.map(|(_, found)| found.error_deg / found.fix.sigma_deg)),
            heading_error_deg: [
                heading_errors().fold(f64::INFINITY, f64::min),
                heading_errors().fold(f64::NEG_INFINITY, f64::max),
            ],
        })
    }
}

fn write_orders(out: &mut dyn Write, rows: &[OrderRow]) -> io::Result<()> {
    writeln!(
        out,
        "| order | fixes | refused | elapsed, s | repeatability, ° (95 %) | worst heading, ° | accuracy rms, ° (95 %) | most, ° \
         | mean error of a heading, ° | error / sigma, rms | flags |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    let interval = |of: Option<[f64; 2]>| of.map_or("–".into(), |[low, high]| format!("{low:.4} … {high:.4}"));
    for row in rows {
        let [least, most] = row.heading_error_deg;
        let flags: Vec<&str> = row.flags.iter().copied().collect();
        writeln!(
            out,
            "| {} | {} | {} | {:.0} | {:.4} ({}) | {:.4} | {:.4} ({}) | {:.4} | {least:+.4} … {most:+.4} | {:.2} | {} |",
            row.order,
            row.fixes,
            row.refused,
            row.elapsed_mean_s,
            row.repeatability_deg,
            interval(row.repeatability_interval_deg),
            row.repeatability_worst_deg,
            row.accuracy_rms_deg,
            interval(row.accuracy_interval_deg),
            row.error_most_deg,
            row.error_over_sigma_rms,
            if flags.is_empty() { "–".into() } else { flags.join(", ") },
        )?;
    }
    Ok(())
}

/// Mean error and standard deviation of every heading, one column an order.
fn write_headings(out: &mut dyn Write, orders: &[Vec<HeadingRow>]) -> io::Result<()> {
    let names: Vec<&str> = orders.iter().filter_map(|rows| Some(rows.first()?.order)).collect();
    writeln!(out, "\nMean error ± standard deviation, °:\n\n| heading, ° | {} |", names.join(" | "))?;
    writeln!(out, "|---|{}", "---|".repeat(names.len()))?;
    for row in orders.first().into_iter().flatten() {
        let cells: Vec<String> = orders
            .iter()
            .filter_map(|rows| rows.iter().find(|other| other.heading_deg == row.heading_deg))
            .map(|row| format!("{:+.4} ± {:.4}", row.mean_error_deg, row.repeatability_deg))
            .collect();
        writeln!(out, "| {} | {} |", row.heading_deg, cells.join(" | "))?;
    }
    Ok(())
}

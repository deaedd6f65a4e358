//! `north bench calibration`: errors of calibrations against their sigmas, against the published formulas and against the
//! Cramér-Rao bound.

use std::io::{self, Write};

use clap::Args;
use indicatif::ProgressBar;
use serde::Serialize;

use super::{Bench, trials};
use crate::trials::{Parameter, Tally, ellipsoid, six_position};
use north::failure::Failure;
use north::progress;

/// Share of trials whose ±1.96 sigma must hold the truth.
const COVERAGE: std::ops::RangeInclusive<f64> = 0.93..=0.97;
/// Largest ratio of an ellipsoid parameter's error to the Cramér-Rao bound.
const MOST_OF_BOUND: f64 = 1.1;
/// Relative room for chance in comparing two rms of the same trials.
const CHANCE: f64 = 1.02;
/// Tables that the effect of is shown, ± arcsec.
const TABLES_ARCSEC: [f64; 3] = [0.0, 3.0, 60.0];

/// Errors of the calibrations against their sigmas and bounds, by Monte Carlo on all cores
///
/// Triads of an independent simulation, drawn at random, are calibrated by the core. Six positions: ten minutes in each,
/// least squares beside the published differences; what a table good to some arcseconds does. Ellipsoid: 23 attitudes of 10 readings against the Cramér-Rao bound. Exit
/// code 1 if an estimate is biased, a coverage is outside of 93 to 97 %, or a bound is missed. Tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench calibration --trials 4000 --json calibration.json")]
pub struct Calibration {
    /// Trials for each table, 100 to 1000000
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// All that was measured.
struct Report {
    trials: u64,
    six_position: Vec<Parameter>,
    six_position_refused: usize,
    tables: Vec<TableEffect>,
    ellipsoid: Vec<Parameter>,
    ellipsoid_refused: usize,
    ellipsoid_norm_rms_before: f64,
    ellipsoid_check_norm_rms: f64,
}

/// What a table's accuracy does to the parameters.
#[derive(Clone, Serialize)]
pub struct TableEffect {
    table_arcsec: f64,
    bias_rms_deg_h: f64,
    matrix_rms_ppm: f64,
    /// The same with gyros without noise: the floor.
    bias_floor_deg_h: f64,
    matrix_floor_ppm: f64,
}

/// One line of one of the tables.
#[derive(Serialize)]
#[serde(tag = "table", rename_all = "kebab-case")]
pub enum Row {
    SixPosition(Parameter),
    TableAccuracy(TableEffect),
    Ellipsoid(Parameter),
    EllipsoidNorm { before_rms_g: f64, check_rms_g: f64 },
}

impl Bench for Calibration {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let report = self.report()?;
        write_report(out, &report)?;
        Ok(report.into_rows())
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let missed: Vec<_> = rows.iter().flat_map(Row::missed).collect();
        if missed.is_empty() { Ok(()) } else { Err(Failure::Refused(missed.join("\nnorth: "))) }
    }
}

impl Calibration {
    fn report(&self) -> Result<Report, Failure> {
        let bar = progress::bar(self.trials * (2 + 2 * TABLES_ARCSEC.len() as u64), "trials");
        let (six_position, six_position_refused) = self.six_position(&six_position::Case::NOMINAL, &bar)?;
        let tables = TABLES_ARCSEC.into_iter().map(|arcsec| self.table(arcsec, &bar)).collect::<Result<_, _>>()?;
        let attitudes = self.trials(self.trials, 2 << 32, &bar, |number| {
            ellipsoid::run(&ellipsoid::Case::NOMINAL, self.seed, number)
        })?;
        bar.finish_and_clear();
        let root_mean = |value: fn(&ellipsoid::Trial) -> f64| {
            let squares: f64 = attitudes.iter().map(|trial| value(trial).powi(2)).sum();
            (squares / attitudes.len() as f64).sqrt()
        };
        Ok(Report {
            trials: self.trials,
            six_position,
            six_position_refused,
            tables,
            ellipsoid: summaries(ellipsoid::NAMES, &attitudes, |trial, i| {
                [trial.errors[i], trial.sigmas[i], trial.bounds[i]]
            }),
            ellipsoid_refused: self.trials as usize - attitudes.len(),
            ellipsoid_norm_rms_before: root_mean(|trial| trial.norm_rms_before),
            ellipsoid_check_norm_rms: root_mean(|trial| trial.check_norm_rms),
        })
    }

    /// Trials numbered from `first`; those that were refused are missing.
    fn trials<T: Send>(
        &self,
        count: u64,
        first: u64,
        bar: &ProgressBar,
        run: impl Fn(u64) -> Option<T> + Sync,
    ) -> Result<Vec<T>, Failure> {
        let trials = trials(first..first + count, bar, run)?;
        Ok(trials.into_iter().flatten().collect())
    }

    fn six_position(&self, case: &six_position::Case, bar: &ProgressBar) -> Result<(Vec<Parameter>, usize), Failure> {
        let trials = self.trials(self.trials, 0, bar, |number| six_position::run(case, self.seed, number))?;
        let summaries = summaries(six_position::NAMES, &trials, |trial, i| {
            let truth = trial.truth[i];
            [trial.solved[i] - truth, trial.sigmas[i], trial.published[i] - truth]
        });
        Ok((summaries, self.trials as usize - trials.len()))
    }

    fn table(&self, table_arcsec: f64, bar: &ProgressBar) -> Result<TableEffect, Failure> {
        let case = six_position::Case { table_arcsec, ..six_position::Case::NOMINAL };
        let mean = |parameters: &[Parameter]| {
            (parameters.iter().map(|parameter| parameter.rms.powi(2)).sum::<f64>() / parameters.len() as f64).sqrt()
        };
        let (noisy, _) = self.six_position(&case, bar)?;
        // A millionth of the noise: the closure still has something to be judged by.
        let quiet = six_position::Case { arw_deg_per_sqrt_h: 1e-6 * case.arw_deg_per_sqrt_h, ..case };
        let (quiet, _) = self.six_position(&quiet, bar)?;
        Ok(TableEffect {
            table_arcsec,
            bias_rms_deg_h: mean(&noisy[..3]),
            matrix_rms_ppm: 1e6 * mean(&noisy[3..]),
            bias_floor_deg_h: mean(&quiet[..3]),
            matrix_floor_ppm: 1e6 * mean(&quiet[3..]),
        })
    }
}

/// Error, sigma and what the error is compared with, of each parameter over all trials.
fn summaries<T, const N: usize>(names: [&str; N], trials: &[T], of: impl Fn(&T, usize) -> [f64; 3]) -> Vec<Parameter> {
    let summary = |(i, name): (usize, &str)| {
        let mut tally = Tally::default();
        for trial in trials {
            let [error, sigma, reference] = of(trial, i);
            tally.push(error, sigma, reference);
        }
        tally.summary(name.into())
    };
    names.into_iter().enumerate().map(summary).collect()
}

impl Report {
    fn into_rows(self) -> Vec<Row> {
        let norm = Row::EllipsoidNorm {
            before_rms_g: self.ellipsoid_norm_rms_before,
            check_rms_g: self.ellipsoid_check_norm_rms,
        };
        let six_position = self.six_position.into_iter().map(Row::SixPosition);
        let tables = self.tables.into_iter().map(Row::TableAccuracy);
        let ellipsoid = self.ellipsoid.into_iter().map(Row::Ellipsoid);
        six_position.chain(tables).chain(ellipsoid).chain([norm]).collect()
    }
}

impl Row {
    /// What the project promises of it and does not keep.
    fn missed(&self) -> Vec<String> {
        let (which, parameter) = match self {
            Self::SixPosition(parameter) => ("six-position", parameter),
            Self::Ellipsoid(parameter) => ("ellipsoid", parameter),
            Self::TableAccuracy(_) | Self::EllipsoidNorm { .. } => return Vec::new(),
        };
        let which = format!("{which} {}", parameter.name);
        let mut missed = Vec::new();
        if !parameter.is_unbiased() {
            missed.push(format!("{which} is biased by {:.3} sigma", parameter.mean_in_sigmas));
        }
        let chance = parameter.coverage_confidence_95;
        if !(COVERAGE.start() - chance..=COVERAGE.end() + chance).contains(&parameter.coverage) {
            missed.push(format!("{which}: coverage {:.1} %", 100.0 * parameter.coverage));
        }
        match self {
            Self::SixPosition(of) if of.rms > CHANCE * of.reference_rms => {
                missed.push(format!("{which}: worse than the published differences"));
            }
            Self::Ellipsoid(of) if of.ratio > MOST_OF_BOUND => {
                missed.push(format!("{which}: {:.3} of the bound", of.ratio));
            }
            _ => {}
        }
        missed
    }
}

fn write_report(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    writeln!(
        out,
        "Six positions, 600 s each, 0.0015 deg/sqrt(h), table +-3 arcsec, {} triads ({} refused)\n",
        report.trials, report.six_position_refused
    )?;
    writeln!(
        out,
        "| parameter | mean error, sigmas | coverage of 95 % | rms, least squares | rms, differences | ratio |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|")?;
    for (i, parameter) in report.six_position.iter().enumerate() {
        let (factor, unit) = if i < 3 { (1.0, "deg/h") } else { (1e6, "ppm") };
        let value = |rms: f64| if i < 3 { format!("{rms:.5}") } else { format!("{:.1}", factor * rms) };
        writeln!(
            out,
            "| {}, {unit} | {:+.3} +- {:.3} | {:.1} % | {} | {} | {:.3} |",
            parameter.name,
            parameter.mean_in_sigmas,
            parameter.mean_confidence_95,
            100.0 * parameter.coverage,
            value(parameter.rms),
            value(parameter.reference_rms),
            parameter.rms / parameter.reference_rms
        )?;
    }
    writeln!(
        out,
        "\n| table, +- arcsec | bias rms, deg/h | matrix rms, ppm | bias, gyros without noise | matrix, gyros without noise |\n\
         |---|---|---|---|---|"
    )?;
    for table in &report.tables {
        writeln!(
            out,
            "| {} | {:.5} | {:.1} | {:.6} | {:.2} |",
            table.table_arcsec,
            table.bias_rms_deg_h,
            table.matrix_rms_ppm,
            table.bias_floor_deg_h,
            table.matrix_floor_ppm
        )?;
    }
    writeln!(
        out,
        "\nEllipsoid, 23 attitudes of 10 readings with 1 mg of noise, {} triads ({} refused)\n",
        report.trials, report.ellipsoid_refused
    )?;
    writeln!(
        out,
        "| parameter | mean error, sigmas | coverage of 95 % | rms | of the Cramer-Rao bound |\n|---|---|---|---|---|"
    )?;
    for parameter in &report.ellipsoid {
        writeln!(
            out,
            "| {} | {:+.3} +- {:.3} | {:.1} % | {:.2e} | {:.3} |",
            parameter.name,
            parameter.mean_in_sigmas,
            parameter.mean_confidence_95,
            100.0 * parameter.coverage,
            parameter.rms,
            parameter.ratio
        )?;
    }
    writeln!(
        out,
        "\nnorm less 1 g, rms: before {:.5}, after, attitudes only judged {:.5}",
        report.ellipsoid_norm_rms_before, report.ellipsoid_check_norm_rms
    )
}

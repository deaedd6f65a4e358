//! `north bench voyage`: the source's experiment with the six-position calibration, against the traditional one.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use north::failure::Failure;
use north::file_error::FileError;
use north::progress;
use north::report::{Axis, Legend, Plot, figure, page};
use serde::Serialize;

use super::{Bench, trials};
use crate::statistics::rms;
use crate::trials::six_position::{Case, NAMES};
use crate::trials::voyage::{self, METHODS, Navigated, TABLES_ARCSEC, Trial};

/// Length of a voyage, as the source's.
const VOYAGE_H: f64 = 15.0;
/// Greatest errors that the source prints, nautical miles: with the traditional and with the six-position calibration.
const SOURCE_NMI: [f64; 2] = [4.38, 1.64];
/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.96;

/// A ship's dead reckoning over 15 hours with the traditional and with the six-position calibration of its triad
///
/// Every triad, drawn at random, is calibrated on a table good to ±3″ and on one good to ±3′: traditionally (a rate test for
/// scale factors and misalignments, then a zero test for the biases) and in six positions of ten minutes (differences, least
/// squares). Then its one recorded voyage, the block indexed through four positions, is navigated with each calibration.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench voyage\n  north bench voyage --voyages 20 --report voyage.html")]
pub struct VoyageBench {
    /// Voyages, 2 to 100000; each takes 108,000 steps with eight calibrations
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    voyages: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Draw the errors against time as an HTML page
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// A line of one of the tables.
#[derive(Serialize)]
#[serde(tag = "table", rename_all = "kebab-case")]
pub enum Row {
    Parameter(Parameter),
    Voyage(Greatest),
    ErrorAgainstTime(AtTime),
}

/// A parameter of the first triad; °/h or parts of one.
#[derive(Serialize)]
pub struct Parameter {
    table_arcsec: f64,
    name: &'static str,
    truth: f64,
    /// By method.
    found: [f64; METHODS.len()],
    /// The differences have none.
    sigma: [Option<f64>; METHODS.len()],
}

/// The greatest position error of a voyage with one calibration, over all voyages.
#[derive(Clone, Serialize)]
pub struct Greatest {
    calibration: &'static str,
    /// ± of the table's angles.
    table_arcsec: Option<f64>,
    bias_rms_deg_h: Option<f64>,
    matrix_rms_ppm: Option<f64>,
    rms_nmi: f64,
    /// Half width of its 95 % interval: an rms r of mean square m is known to δm/2r.
    confidence_95_nmi: f64,
    /// By how much less than with the traditional calibration on the same table, %.
    less_than_traditional_percent: Option<f64>,
}

/// The position error at one time, over all voyages and in the first.
#[derive(Serialize)]
pub struct AtTime {
    hours: f64,
    calibration: &'static str,
    table_arcsec: Option<f64>,
    rms_nmi: f64,
    first_voyage_nmi: f64,
}

/// What a column of [`Trial::navigated`] was navigated with: a place in [`TABLES_ARCSEC`] and one in [`METHODS`].
#[derive(Clone, Copy, PartialEq)]
enum With {
    Nothing,
    Calibration(usize, usize),
    Truth,
}

impl With {
    /// In the order of the columns.
    fn all() -> impl Iterator<Item = Self> {
        let on_table = |table| (0..METHODS.len()).map(move |method| Self::Calibration(table, method));
        [Self::Nothing].into_iter().chain((0..TABLES_ARCSEC.len()).flat_map(on_table)).chain([Self::Truth])
    }

    fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::Calibration(_, method) => METHODS[method],
            Self::Truth => "the true parameters",
        }
    }

    fn table_arcsec(self) -> Option<f64> {
        if let Self::Calibration(table, _) = self { Some(TABLES_ARCSEC[table]) } else { None }
    }
}

impl Bench for VoyageBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.voyages, "voyages");
        let all = trials(0..self.voyages, &bar, |number| {
            voyage::run(Case::NOMINAL.latitude_deg, VOYAGE_H, self.seed, number)
        })?;
        bar.finish_and_clear();
        let sailed: Vec<_> = all.into_iter().flatten().collect();
        let Some(first) = sailed.first() else {
            return Err(Failure::Refused("every calibration was refused".into()));
        };
        let parameters: Vec<_> = (0..TABLES_ARCSEC.len()).flat_map(|table| parameters(first, table)).collect();
        let greatest = greatest(&sailed);
        let times = times(&sailed);
        write_parameters(out, &parameters)?;
        write_greatest(out, &greatest, self.voyages, sailed.len())?;
        if let Some(path) = &self.report {
            north::output::write(path, html(&times)).map_err(|error| FileError::whole(path, error))?;
        }
        let rows = parameters.into_iter().map(Row::Parameter).chain(greatest.into_iter().map(Row::Voyage));
        Ok(rows.chain(times.into_iter().map(Row::ErrorAgainstTime)).collect())
    }
}

fn parameters(trial: &Trial, table: usize) -> impl Iterator<Item = Parameter> + '_ {
    let found = trial.calibrations[table];
    NAMES.into_iter().enumerate().map(move |(i, name)| Parameter {
        table_arcsec: TABLES_ARCSEC[table],
        name,
        truth: trial.truth.flat()[i],
        found: found.map(|parameters| parameters.flat()[i]),
        sigma: found.map(|parameters| Some(parameters.sigmas()[i]).filter(|sigma| sigma.is_finite())),
    })
}

fn greatest(sailed: &[Trial]) -> Vec<Greatest> {
    let count = sailed.len() as f64;
    let mut rows: Vec<Greatest> = Vec::new();
    for (column, with) in With::all().enumerate() {
        let squares = || sailed.iter().map(|trial| trial.navigated[column].greatest_nmi.powi(2));
        let mean = squares().sum::<f64>() / count;
        let variance = squares().map(|square| (square - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let errors = |part: std::ops::Range<usize>| {
            let With::Calibration(table, method) = with else { return None };
            let of = move |trial: &Trial| {
                let (found, truth) = (trial.calibrations[table][method].flat(), trial.truth.flat());
                part.clone().map(move |i| found[i] - truth[i])
            };
            Some(rms(sailed.iter().flat_map(of)))
        };
        let traditional = rows.iter().rev().find(|row| row.calibration == METHODS[0]);
        let gain = |row: &Greatest| 100.0 * (1.0 - mean.sqrt() / row.rms_nmi);
        let less_than_traditional_percent = traditional.filter(|row| row.table_arcsec == with.table_arcsec()).map(gain);
        rows.push(Greatest {
            calibration: with.name(),
            table_arcsec: with.table_arcsec(),
            bias_rms_deg_h: errors(0..3),
            matrix_rms_ppm: errors(3..NAMES.len()).map(|rms| 1e6 * rms),
            rms_nmi: mean.sqrt(),
            confidence_95_nmi: Z_95 * (variance / count).sqrt() / (2.0 * mean.sqrt()),
            less_than_traditional_percent,
        });
    }
    rows
}

fn times(sailed: &[Trial]) -> Vec<AtTime> {
    let count = sailed.first().map_or(0, |trial| trial.navigated[0].errors_nmi.len());
    let error = |navigated: &Navigated, i: usize| navigated.errors_nmi[i];
    With::all()
        .enumerate()
        .flat_map(|(column, with)| (0..count).map(move |i| (column, with, i)))
        .map(|(column, with, i)| AtTime {
            hours: voyage::hours(i),
            calibration: with.name(),
            table_arcsec: with.table_arcsec(),
            rms_nmi: rms(sailed.iter().map(|trial| error(&trial.navigated[column], i))),
            first_voyage_nmi: error(&sailed[0].navigated[column], i),
        })
        .collect()
}

fn write_parameters(out: &mut dyn Write, parameters: &[Parameter]) -> io::Result<()> {
    writeln!(out, "Parameters of the first triad with their standard deviations (biases in deg/h)\n")?;
    writeln!(out, "| table, +- | parameter | truth | {} |\n|---|---|---|---|---|---|", METHODS.join(" | "))?;
    for parameter in parameters {
        let bias = parameter.name.ends_with('0');
        let value = |value: f64| if bias { format!("{value:+.5}") } else { format!("{value:+.6}") };
        let sigma = |sigma: f64| if bias { format!("{sigma:.5}") } else { format!("{sigma:.6}") };
        let mut cells = String::new();
        for (found, of) in parameter.found.into_iter().zip(parameter.sigma) {
            let _ = write!(cells, " {}{} |", value(found), of.map_or(String::new(), |of| format!(" ± {}", sigma(of))));
        }
        let table = arc(parameter.table_arcsec);
        writeln!(out, "| {table} | {} | {} |{cells}", parameter.name, value(parameter.truth))?;
    }
    Ok(())
}

fn write_greatest(out: &mut dyn Write, rows: &[Greatest], voyages: u64, sailed: usize) -> io::Result<()> {
    writeln!(
        out,
        "\nGreatest error of a ship's dead reckoning in {VOYAGE_H} h, {sailed} voyages ({} with a calibration refused)\n",
        voyages - sailed as u64
    )?;
    writeln!(
        out,
        "| calibration | table, +- | bias rms, deg/h | matrix rms, ppm | rms, n mile | less than traditional by |\n\
         |---|---|---|---|---|---|"
    )?;
    for row in rows {
        let cell = |value: Option<String>| value.unwrap_or_else(|| "-".into());
        writeln!(
            out,
            "| {} | {} | {} | {} | {:.2} ± {:.2} | {} |",
            row.calibration,
            cell(row.table_arcsec.map(arc)),
            cell(row.bias_rms_deg_h.map(|rms| format!("{rms:.5}"))),
            cell(row.matrix_rms_ppm.map(|rms| format!("{rms:.1}"))),
            row.rms_nmi,
            row.confidence_95_nmi,
            cell(row.less_than_traditional_percent.map(|percent| format!("{percent:.1} %")))
        )?;
    }
    let [traditional, six] = SOURCE_NMI;
    writeln!(out, "| traditional, as the source prints it | | | | {traditional} | - |")?;
    writeln!(
        out,
        "| six positions, as the source prints it | | | | {six} | {:.1} % |",
        100.0 * (1.0 - six / traditional)
    )
}

/// ± of a table's angles, in the unit in which it is spoken of.
fn arc(arcsec: f64) -> String {
    if arcsec < 60.0 { format!("{arcsec}″") } else { format!("{}′", arcsec / 60.0) }
}

/// Class of a line and what it stands for.
const LINES: [(&str, &str); 4] = [
    ("line before", "traditional"),
    ("split", "six positions, differences"),
    ("line after", "six positions, least squares"),
    ("reference", "the true parameters"),
];

fn html(times: &[AtTime]) -> String {
    let mut body = String::from("<h1>What a calibration is worth to a ship</h1>\n");
    for (heading, value) in [
        ("Over all voyages, root mean square", (|at| at.rms_nmi) as fn(&AtTime) -> f64),
        ("One recorded voyage", |at| at.first_voyage_nmi),
    ] {
        for arcsec in TABLES_ARCSEC {
            let of = |name: &str| {
                let on = |at: &&AtTime| at.table_arcsec.is_none_or(|table| table == arcsec);
                let line = times.iter().filter(move |at| at.calibration == name).filter(on);
                line.map(|at| (at.hours, value(at))).collect::<Vec<_>>()
            };
            let all: Vec<_> = LINES.iter().flat_map(|(_, name)| of(name)).collect();
            let about = format!("{heading}; calibrated on a table good to ±{}", arc(arcsec));
            let caption = format!("{about}. Error of the position against time, navigated from one recording.");
            body += &figure(Legend::Named(&LINES), &about, &caption, |canvas| {
                let x = Axis::exact("hours", 0.0, VOYAGE_H);
                let y = Axis::linear("error, n mile", all.iter().map(|point| point.1).chain([0.0]));
                let mut plot = Plot::new(canvas.width, 300.0, x, y);
                LINES.iter().for_each(|(class, name)| plot.line(class, of(name)));
                vec![plot]
            });
        }
    }
    page("Calibrations and a voyage", &body)
}

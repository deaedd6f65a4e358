//! A campaign as one table, in a Parquet file or in memory: a row for every row of every run, with what the manifest says of its run.

use std::path::Path;

use north_finder::effects::channel::LEVEL_TEMPERATURE;

use super::{Campaign, Role, Row, Run, RunReader};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::interrupt;
use crate::parquet_table::ParquetTable;

/// Columns of text, of numbers that every table has, and after these those of the channels.
const TEXTS: [&str; 2] = ["run", "role"];
const NUMBERS: [&str; 10] = [
    "latitude_deg",
    "reference_azimuth_deg",
    "t_s",
    "index_deg",
    "fog_arcsec",
    "temp_c",
    "ax_g",
    "ay_g",
    LEVEL_TEMPERATURE,
    "lost_frames",
];

/// Writes the table. Gives the number of its rows; after an error nothing is left.
///
/// Errors: a run that cannot be read, a file that is there or cannot be written, an interrupt.
pub fn write_parquet(campaign: &Campaign, path: &Path) -> Result<u64, Failure> {
    let channels = channels(campaign)?;
    let names = NUMBERS.into_iter().chain(channels.iter().map(String::as_str));
    let mut table = ParquetTable::create(path, "campaign", &TEXTS, names)?;
    for run in &campaign.runs {
        let reader = RunReader::open(&campaign.path_of(run))?;
        let places = places(&channels, &reader);
        let role = if run.role == Role::Fit { "fit" } else { "check" };
        for row in reader {
            table.push([run.file.as_str(), role], numbers(campaign, run, &row?, &places))?;
        }
    }
    table.finish()
}

/// The names of the further channels of all runs, in the order in which they first come.
fn channels(campaign: &Campaign) -> Result<Vec<String>, FileError> {
    let mut names = Vec::new();
    for run in &campaign.runs {
        for name in RunReader::open(&campaign.path_of(run))?.channels() {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
    }
    Ok(names)
}

/// What a row has in the columns of numbers.
fn numbers(campaign: &Campaign, run: &Run, row: &Row, places: &[Option<usize>]) -> impl Iterator<Item = Option<f64>> {
    let known = [
        campaign.latitude_of(run),
        run.reference_azimuth_deg,
        Some(row.t_s),
        Some(row.index_deg),
        Some(row.fog_arcsec),
        row.temp_c,
        row.level.map(|level| level.forward),
        row.level.map(|level| level.left),
        row.level_temp_c,
        Some(row.lost_frames.into()),
    ];
    known.into_iter().chain(places.iter().map(|place| row.extra.get((*place)?).copied()))
}

/// Where the channels of all runs are in the rows of this one.
fn places(channels: &[String], reader: &RunReader) -> Vec<Option<usize>> {
    channels.iter().map(|name| reader.channels().iter().position(|channel| channel == name)).collect()
}

/// A campaign as columns in memory, each as long as there are rows in all runs.
#[derive(Debug)]
pub struct Columns {
    /// Number of the run in the campaign, from 0.
    pub run: Vec<u32>,
    /// Names of the columns of numbers.
    pub names: Vec<String>,
    /// NaN where a row has no value.
    pub numbers: Vec<Vec<f64>>,
}

impl Columns {
    /// Reads all rows. Errors: a run that cannot be read, an interrupt.
    pub fn read(campaign: &Campaign) -> Result<Self, Failure> {
        let channels = channels(campaign)?;
        let names: Vec<String> = NUMBERS.into_iter().map(String::from).chain(channels.iter().cloned()).collect();
        let mut columns = Self { run: Vec::new(), numbers: vec![Vec::new(); names.len()], names };
        for (number, run) in (0..).zip(&campaign.runs) {
            let reader = RunReader::open(&campaign.path_of(run))?;
            let places = places(&channels, &reader);
            for row in reader {
                let row = row?;
                columns.run.push(number);
                for (column, value) in columns.numbers.iter_mut().zip(self::numbers(campaign, run, &row, &places)) {
                    column.push(value.unwrap_or(f64::NAN));
                }
            }
            if interrupt::requested() {
                return Err(Failure::Interrupted);
            }
        }
        Ok(columns)
    }
}

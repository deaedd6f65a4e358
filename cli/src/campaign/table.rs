//! A campaign as one table, in a Parquet file or in memory: a row for every row of every run, with what the manifest says of its run.

use std::io;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::{Campaign, Role, Row, Run, RunReader};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::interrupt;
use crate::output::{self, Output};

/// Columns of text, of numbers that every table has, and after these those of the channels.
const TEXTS: [&str; 2] = ["run", "role"];
const NUMBERS: [&str; 9] = [
    "latitude_deg",
    "reference_azimuth_deg",
    "t_s",
    "index_deg",
    "fog_arcsec",
    "temp_c",
    "ax_g",
    "ay_g",
    "lost_frames",
];
/// Rows that are kept until they are written.
const ROWS: usize = 65_536;

/// Writes the table. Gives the number of its rows; after an error nothing is left.
///
/// Errors: a run that cannot be read, a file that is there or cannot be written, an interrupt.
pub fn write_parquet(campaign: &Campaign, path: &Path) -> Result<u64, Failure> {
    let channels = channels(campaign)?;
    let file = output::create(path).map_err(|error| FileError::whole(path, error))?;
    Table::new(file, channels, path)?.fill(campaign)
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

struct Table<'a> {
    path: &'a Path,
    writer: SerializedFileWriter<Output>,
    channels: Vec<String>,
    texts: [Vec<ByteArray>; TEXTS.len()],
    numbers: Vec<Vec<Option<f64>>>,
    rows: u64,
}

impl<'a> Table<'a> {
    fn new(file: Output, channels: Vec<String>, path: &'a Path) -> Result<Self, Failure> {
        let failed = |error| failure(path, error);
        let mut fields = Vec::new();
        for name in TEXTS {
            let text = Type::primitive_type_builder(name, Physical::BYTE_ARRAY);
            fields
                .push(text.with_repetition(Repetition::REQUIRED).with_logical_type(Some(LogicalType::String)).build());
        }
        for name in NUMBERS.into_iter().chain(channels.iter().map(String::as_str)) {
            fields.push(
                Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::OPTIONAL).build(),
            );
        }
        let fields =
            fields.into_iter().map(|field| field.map(Arc::new)).collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let schema = Type::group_type_builder("campaign").with_fields(fields).build().map_err(failed)?;
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).map_err(failed)?;
        let numbers = vec![Vec::new(); NUMBERS.len() + channels.len()];
        Ok(Self { path, writer, channels, texts: Default::default(), numbers, rows: 0 })
    }

    fn fill(mut self, campaign: &Campaign) -> Result<u64, Failure> {
        for run in &campaign.runs {
            let reader = RunReader::open(&campaign.path_of(run))?;
            let places = places(&self.channels, &reader);
            for row in reader {
                self.push(campaign, run, &row?, &places);
                if self.texts[0].len() == ROWS {
                    self.flush()?;
                }
            }
        }
        self.flush()?;
        let (path, rows) = (self.path, self.rows);
        let file = self.writer.into_inner().map_err(|error| failure(path, error))?;
        file.finish().map_err(|error| FileError::whole(path, error))?;
        Ok(rows)
    }

    fn push(&mut self, campaign: &Campaign, run: &Run, row: &Row, places: &[Option<usize>]) {
        let role = if run.role == Role::Fit { "fit" } else { "check" };
        for (column, text) in self.texts.iter_mut().zip([run.file.as_str(), role]) {
            column.push(text.into());
        }
        for (column, value) in self.numbers.iter_mut().zip(numbers(campaign, run, row, places)) {
            column.push(value);
        }
        self.rows += 1;
    }

    /// Writes the rows that are kept.
    fn flush(&mut self) -> Result<(), Failure> {
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        let path = self.path;
        self.write_group().map_err(|error| failure(path, error))
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.texts[0].is_empty() {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        let (mut texts, mut numbers) = (self.texts.iter_mut(), self.numbers.iter_mut());
        while let Some(mut column) = group.next_column()? {
            match column.untyped() {
                ColumnWriter::ByteArrayColumnWriter(typed) => {
                    let values = texts.next().map(std::mem::take).unwrap_or_default();
                    typed.write_batch(&values, None, None)?;
                }
                ColumnWriter::DoubleColumnWriter(typed) => {
                    let values = numbers.next().map(std::mem::take).unwrap_or_default();
                    let levels: Vec<i16> = values.iter().map(|value| value.is_some().into()).collect();
                    let values: Vec<f64> = values.into_iter().flatten().collect();
                    typed.write_batch(&values, Some(&levels), None)?;
                }
                _ => return Err(ParquetError::General("a column is neither text nor a number".into())),
            }
            column.close()?;
        }
        group.close()?;
        Ok(())
    }
}

fn failure(path: &Path, error: ParquetError) -> Failure {
    FileError::whole(path, io::Error::other(error)).into()
}

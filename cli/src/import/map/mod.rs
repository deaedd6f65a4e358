//! The mapping file: what a foreign recording's columns are, and which runs are to be cut from it.

mod check;

use std::num::NonZeroU64;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use self::check::Raw;
use super::axes::Axes;
use super::unit::{AccelerationUnit, GyroUnit, TemperatureUnit, TimeUnit};
use super::windows::Windows;
use crate::campaign::Instrument;
use crate::file_error::FileError;
use crate::toml_file::TomlFile;

/// The format number of mapping files.
const FORMAT: i64 = 1;

/// A mapping, checked as far as it can be without the recording.
pub struct Map {
    /// For errors that are found only with the recording at hand.
    pub file: TomlFile,
    pub title: Option<String>,
    pub latitude_deg: f64,
    pub instrument: Option<Instrument>,
    pub text: Text,
    pub time: Time,
    /// Samples that make one row.
    pub samples_per_row: u32,
    pub gyro: Gyro,
    pub accelerometer: Option<Accelerometer>,
    pub temperature: Option<Temperature>,
    pub index: Index,
    pub channels: Vec<Channel>,
    pub windows: Windows,
}

/// A column by its number, from 1, or by its name in the header.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a column's number (from 1) or its name in the header")]
pub enum Column {
    Number(usize),
    Name(String),
}

/// How a text file is written.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Text {
    /// One character, "tab" or "whitespace" (any number of blanks and tabs).
    pub delimiter: Spanned<String>,
    /// Lines that begin with this are skipped, as empty lines are.
    pub comment: String,
    /// Rows before the data, comments not counted.
    pub header_rows: usize,
    /// Which of them names the columns, from 1; the last, if it is not said.
    pub names_row: Option<Spanned<usize>>,
    /// Numbers are written 3,14.
    pub decimal_comma: bool,
    /// Lines at the end of the file that are no data: sums, signatures.
    pub footer_rows: usize,
    /// The data end before the first line that begins with this; empty: they do not.
    pub stop_at: String,
    /// Most rows of data that are read.
    pub rows: Option<Spanned<NonZeroU64>>,
}

/// When samples were taken.
#[derive(Clone, Debug, Default)]
pub struct Time {
    /// Time stamp, the end of the sample's interval: one column, or several that are added (hours, minutes, seconds), each
    /// with its unit.
    pub columns: Vec<(Spanned<Column>, TimeUnit)>,
    /// Declared interval between samples, seconds.
    pub interval_s: Option<f64>,
    /// How long the whole recording took by a clock that is not the gyro's, seconds.
    pub duration_s: Option<f64>,
}

#[derive(Debug)]
pub struct Gyro {
    /// One, or the three of a triad.
    pub columns: Vec<Spanned<Column>>,
    pub unit: GyroUnit,
    pub scale: Vec<f64>,
    /// Of a triad.
    pub axes: Option<Axes>,
}

#[derive(Debug)]
pub struct Accelerometer {
    /// Two or three.
    pub columns: Vec<Spanned<Column>>,
    pub unit: AccelerationUnit,
    pub scale: Vec<f64>,
    pub axes: Axes,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    pub column: Spanned<Column>,
    #[serde(default)]
    pub unit: TemperatureUnit,
    #[serde(default = "one")]
    pub scale: f64,
    #[serde(default)]
    pub offset: f64,
}

/// Where the gyro's sensitive axis pointed, relative to the mark.
#[derive(Debug)]
pub enum Index {
    /// Measured: of a single gyro. Degrees counter-clockwise from above = column · scale + offset.
    Measured { column: Spanned<Column>, scale: f64, offset_deg: f64 },
    /// Chosen: of a triad, read as a single gyro that stays at these angles one after the other, `dwell_s` each.
    Virtual { angles_deg: Vec<f64>, dwell_s: f64 },
    /// Declared: a single gyro, a file for each position, at the angle that the run says.
    Placed,
}

/// Any other column, kept under a name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    pub name: Spanned<String>,
    pub column: Spanned<Column>,
    #[serde(default = "one")]
    pub scale: f64,
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

impl Default for Text {
    fn default() -> Self {
        let delimiter = Spanned::new(0..0, ",".to_owned());
        Self {
            delimiter,
            comment: "#".into(),
            header_rows: 1,
            names_row: None,
            decimal_comma: false,
            footer_rows: 0,
            stop_at: String::new(),
            rows: None,
        }
    }
}

impl Map {
    /// Reads a mapping file.
    ///
    /// Errors, all with line and column: unknown or missing keys, values out of range, axes that are no right-handed
    /// triad, an index that does not fit the gyro, runs that make no sense.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let file = TomlFile::read(path)?;
        let raw: Raw = file.parse_format(FORMAT)?;
        raw.check(file)
    }
}

impl Index {
    /// Length of a run of a virtual index, seconds.
    pub fn schedule_s(&self) -> Option<f64> {
        match self {
            Self::Measured { .. } | Self::Placed => None,
            Self::Virtual { angles_deg, dwell_s } => Some(angles_deg.len() as f64 * dwell_s),
        }
    }
}

//! `north calibrate`: calibrations of triads.

mod accelerometer_six_position;
mod ellipsoid;
mod field;
mod gravity;
mod simulate;
mod six_position;

use std::io::{self, Write};
use std::path::Path;

use clap::{Args, Subcommand};

use crate::calibrate::attitudes::Rejected;
use crate::count::counted;
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::model_file::Triads;
use crate::output;

/// Calibrate a gyro triad or an accelerometer triad
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate six-position table-2026-05-04 --model-out triad.toml
  north calibrate ellipsoid readings.csv --latitude 34.75 --height 120 --json -
  north calibrate accelerometer-six-position faces.csv --model-out accelerometers.toml")]
pub struct Calibrate {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    SixPosition(six_position::SixPosition),
    Ellipsoid(ellipsoid::Ellipsoid),
    AccelerometerSixPosition(accelerometer_six_position::AccelerometerSixPosition),
    Field(field::Field),
    Simulate(simulate::Simulate),
}

impl Calibrate {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::SixPosition(six_position) => six_position.run(),
            What::Ellipsoid(ellipsoid) => ellipsoid.run(),
            What::AccelerometerSixPosition(six_position) => six_position.run(),
            What::Field(field) => field.run(),
            What::Simulate(simulate) => simulate.run(),
        }
    }
}

/// Writes a model where a file is named for it; warns of one that commands refuse.
fn write_model(path: Option<&Path>, triads: &Triads) -> Result<(), FileError> {
    let Some(path) = path else { return Ok(()) };
    triads.write(path)?;
    if let Some(doubt) = triads.doubt() {
        output::warn(format_args!("{}: {doubt}", path.display()));
    }
    Ok(())
}

/// The rows of a matrix with their standard deviations.
fn write_rows(out: &mut dyn Write, values: &[[f64; 3]; 3], sigmas: &[[f64; 3]; 3], decimals: usize) -> io::Result<()> {
    for ((name, row), sigmas) in ["x", "y", "z"].iter().zip(values).zip(sigmas) {
        write!(out, "  {name}")?;
        for (value, sigma) in row.iter().zip(sigmas) {
            write!(out, "  {value:+.decimals$} ± {sigma:.decimals$}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// What was left out of a recording in attitudes at rest.
fn write_rejected(out: &mut dyn Write, rejected: &[Rejected]) -> io::Result<()> {
    for rejected in rejected {
        let time = rejected.t_s.map_or(String::new(), |[from_s, to_s]| format!(" ({from_s:.1} to {to_s:.1} s)"));
        writeln!(
            out,
            "left out: attitude {}{time}, {}: {}",
            rejected.attitude,
            counted(rejected.readings, "reading"),
            rejected.why
        )?;
    }
    Ok(())
}

/// Decimals that show two digits of the least of these standard deviations but 0; whatever the unit is.
fn decimals(sigmas: impl IntoIterator<Item = f64>) -> usize {
    let least = sigmas.into_iter().filter(|sigma| *sigma > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { (1.0 - least.log10().floor()).clamp(0.0, 18.0) as usize } else { 6 }
}

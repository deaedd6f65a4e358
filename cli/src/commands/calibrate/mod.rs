//! `north calibrate`: calibrations of triads.

mod ellipsoid;
mod field;
mod simulate;
mod six_position;

use std::io::{self, Write};

use clap::{Args, Subcommand};

use crate::failure::Failure;

/// Calibrate a gyro triad or an accelerometer triad
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate six-position table-2026-05-04 --model-out triad.toml
  north calibrate ellipsoid readings.csv --gravity 9.81 --json -")]
pub struct Calibrate {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    SixPosition(six_position::SixPosition),
    Ellipsoid(ellipsoid::Ellipsoid),
    Field(field::Field),
    Simulate(simulate::Simulate),
}

impl Calibrate {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::SixPosition(six_position) => six_position.run(),
            What::Ellipsoid(ellipsoid) => ellipsoid.run(),
            What::Field(field) => field.run(),
            What::Simulate(simulate) => simulate.run(),
        }
    }
}

/// The rows of a matrix, each with what is beside it.
fn write_rows(out: &mut dyn Write, columns: [&[[f64; 3]; 3]; 2], decimals: [usize; 2]) -> io::Result<()> {
    let [values, sigmas] = columns;
    for ((name, row), sigmas) in ["x", "y", "z"].iter().zip(values).zip(sigmas) {
        write!(out, "  {name}")?;
        for (value, sigma) in row.iter().zip(sigmas) {
            let [decimals, of_sigma] = decimals;
            write!(out, "  {value:+.decimals$} ± {sigma:.of_sigma$}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

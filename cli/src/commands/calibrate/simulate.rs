//! `north calibrate simulate`: recordings to try a calibration on, with the truth beside them.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use hal_sim::triad::{Placement, SIX_POSITIONS, Shock, Table, TableRow, Visit, drawn, even_directions, place_by_hand};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::commands::{number, seed};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::model_file::{Accelerometer, GyroTriad, Triads};

/// Accuracy of the simulated table, ± arcsec.
const TABLE_ARCSEC: f64 = 3.0;
/// Time in which the table comes to a position, and leaves it, within the recording, s.
const MOVE_S: f64 = 6.0;

/// Write a simulated recording, and the truth as truth.toml beside it
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north calibrate simulate six-position --out table && north calibrate six-position table")]
pub struct Simulate {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    SixPosition(SixPosition),
    Ellipsoid(Ellipsoid),
}

/// A random gyro triad in the six positions: the table moves at both ends of each recording, and strikes the triad in one
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north calibrate simulate six-position --out table --seed 7 --seconds 600")]
struct SixPosition {
    /// Folder for calibration.toml, the recordings and truth.toml; new or empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = seed)]
    seed: u64,
    /// Latitude, degrees, north positive
    #[arg(long, value_name = "DEG", default_value_t = 34.75, allow_negative_numbers = true, value_parser = number::<-89, 89>)]
    latitude: f64,
    /// Time in each position, s
    #[arg(long, value_name = "S", default_value_t = 600.0, value_parser = number::<60, 36_000>)]
    seconds: f64,
    /// Rows per second
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = number::<1, 400>)]
    rate_hz: f64,
}

/// A random accelerometer triad, put down by hand in one attitude after the other
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north calibrate simulate ellipsoid --out hand --attitudes 23")]
struct Ellipsoid {
    /// Folder for readings.csv and truth.toml; new or empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = seed)]
    seed: u64,
    /// Number of attitudes
    #[arg(long, value_name = "N", default_value_t = 23, value_parser = clap::value_parser!(u16).range(1..=1000))]
    attitudes: u16,
}

impl Simulate {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::SixPosition(six_position) => six_position.run(),
            What::Ellipsoid(ellipsoid) => ellipsoid.run(),
        }
    }
}

impl SixPosition {
    fn run(self) -> Result<(), Failure> {
        prepare(&self.out)?;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let errors = drawn::gyros(&mut random);
        let mut table = Table::new(self.latitude, &errors, random.random());
        let mut manifest = format!(
            "format = 1\ntitle = \"simulated, seed {}\"\nlatitude_deg = {:?}\ntable_arcsec = {TABLE_ARCSEC:?}\n",
            self.seed, self.latitude
        );
        let mut from_deg = SIX_POSITIONS[5].angles_deg;
        for (i, position) in SIX_POSITIONS.iter().enumerate() {
            table.set_error([(); 3].map(|()| random.random_range(-TABLE_ARCSEC..TABLE_ARCSEC)));
            let shock = Shock { at_s: 0.4 * self.seconds, swing_arcsec: 300.0, turned_arcsec: [0.0; 3] };
            let visit = Visit {
                interval_s: 1.0 / self.rate_hz,
                moves_from_deg: Some(from_deg),
                move_s: MOVE_S,
                shocks: if i == 2 { vec![shock] } else { Vec::new() },
                ..Visit::at_rest(position.angles_deg, self.seconds)
            };
            from_deg = position.angles_deg;
            let name = format!("position-{}.csv", i + 1);
            manifest += &format!("\n[[position]]\nfile = \"{name}\"\naxes = \"{}\"\n", position.axes);
            let rows = table.visit(&visit);
            write_csv(&self.out.join(name), "t_s,gx_arcsec,gy_arcsec,gz_arcsec,temp_c", rows.len(), |i| {
                let TableRow { t_s, arcsec: [x, y, z], temp_c } = rows[i];
                format!("{t_s:.4},{x:.6},{y:.6},{z:.6},{temp_c:.2}")
            })?;
        }
        let path = self.out.join("calibration.toml");
        crate::output::write(&path, manifest).map_err(|error| FileError::whole(&path, error))?;
        let truth = GyroTriad {
            bias_deg_h: errors.bias_deg_h,
            matrix: table.triad().matrix(),
            sigma_bias_deg_h: None,
            sigma_matrix: None,
        };
        let truth = Triads { gyro_triad: Some(truth), ..Triads::default() };
        Ok(truth.write(&self.out.join("truth.toml"))?)
    }
}

impl Ellipsoid {
    fn run(self) -> Result<(), Failure> {
        prepare(&self.out)?;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let triad = drawn::accelerometers(&mut random);
        let placement = Placement {
            up: even_directions(self.attitudes.into(), random.random()),
            rest_s: 4.0,
            move_s: 2.0,
            rate_hz: 100.0,
            shake_g: 0.05,
            rest_shake_g: 0.0,
        };
        let readings = place_by_hand(&triad, &placement, random.random());
        write_csv(&self.out.join("readings.csv"), "t_s,ax_g,ay_g,az_g", readings.len(), |i| {
            let [x, y, z] = readings[i].raw;
            format!("{:.4},{x:.7},{y:.7},{z:.7}", readings[i].t_s)
        })?;
        let (bias, matrix) = triad.correction();
        let truth = Accelerometer { gravity: 1.0, bias, matrix, sigma_bias: None, sigma_matrix: None };
        let truth = Triads { accelerometer: Some(truth), ..Triads::default() };
        Ok(truth.write(&self.out.join("truth.toml"))?)
    }
}

/// A folder that is new or empty.
fn prepare(folder: &Path) -> Result<(), FileError> {
    fs::create_dir_all(folder).map_err(|error| FileError::whole(folder, error))?;
    let mut entries = fs::read_dir(folder).map_err(|error| FileError::whole(folder, error))?;
    if entries.next().is_some() {
        return Err(FileError::whole(folder, Problem::FolderNotEmpty));
    }
    Ok(())
}

fn write_csv(path: &Path, header: &str, rows: usize, row: impl Fn(usize) -> String) -> Result<(), FileError> {
    let write = || -> io::Result<()> {
        let mut out = crate::output::create(path)?;
        writeln!(out, "{header}")?;
        for i in 0..rows {
            writeln!(out, "{}", row(i))?;
        }
        out.finish()
    };
    write().map_err(|error| FileError::whole(path, error))
}

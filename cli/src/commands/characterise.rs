//! `north characterise`: a gyro's noise and the settings that follow from it.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::characterise::{self, Character, Suggested};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::output::{self, JsonOption};

/// Noise of a gyro from a still recording: Allan deviation, what it is made of, and the settings that follow
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north characterise still.csv --settings-out unit-7-settings.toml

The recording is a run (docs/formats.md) in which the index never moves: an hour or more, at the final temperature, on
firm ground.")]
pub struct Characterise {
    /// A run as a CSV file with t_s, index_deg and fog_arcsec
    #[arg(value_name = "FILE.csv")]
    recording: PathBuf,
    /// Write the settings that follow, as a file for `--settings`
    #[arg(long, value_name = "FILE")]
    settings_out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

#[derive(Serialize)]
struct Result {
    #[serde(flatten)]
    character: Character,
    settings: Suggested,
}

impl Characterise {
    pub fn run(self) -> std::result::Result<(), Failure> {
        output::check([self.settings_out.as_deref(), self.json.path()])?;
        let character = Character::of(&characterise::read(&self.recording)?);
        if character.allan.is_empty() {
            let why = "the gyro repeats the same increment: it is dead, or the column is not its reading";
            return Err(Failure::Refused(format!("{}: {why}", self.recording.display())));
        }
        let settings = character.suggested();
        write(&mut self.json.human(), &character, &settings)?;
        if let Some(path) = &self.settings_out {
            output::write(path, settings.to_toml()).map_err(|error| FileError::whole(path, error))?;
        }
        self.json.write(&Result { character, settings })
    }
}

fn write(out: &mut dyn Write, character: &Character, settings: &Suggested) -> io::Result<()> {
    writeln!(
        out,
        "{:.0} s at {} s a row; mean rate {:+.4} °/h\n\n   averaging   Allan deviation",
        character.seconds, character.interval_s, character.mean_deg_h
    )?;
    for point in &character.allan {
        writeln!(out, "{:10.4} s   {:.6} °/h ± {:.0} %", point.tau_s, point.sigma_deg_h, 100.0 * point.relative)?;
    }
    let noise = &character.noise;
    let mut coefficient = |name: &str, value: f64, unit: &str| match value > 0.0 {
        true => writeln!(out, "{name:<32} {value:.6} {unit}"),
        false => writeln!(out, "{name:<32} not seen in this recording"),
    };
    coefficient("\nquantisation, Q", noise.quantisation_arcsec, "arcsec")?;
    coefficient("angle random walk, N", noise.angle_random_walk_deg_per_sqrt_h, "°/√h")?;
    coefficient("bias instability, B", noise.bias_instability_deg_h, "°/h")?;
    coefficient("rate random walk, K", noise.rate_random_walk_deg_h_per_sqrt_h, "°/h/√h")?;
    coefficient("rate ramp, R", noise.rate_ramp_deg_h_per_h, "°/h per hour")?;
    let (correlation, sigma) = (character.autocorrelation_1s, character.autocorrelation_sigma);
    let verdict = if correlation.abs() < 3.0 * sigma {
        "white"
    } else if correlation < 0.0 {
        "noise of the angle: counts, dither or a ring laser"
    } else {
        "not white: temperature, vibration or a moving base"
    };
    writeln!(out, "{:<31} {correlation:+.3} ± {sigma:.3}: {verdict}", "correlation of 1 s rates")?;
    match character.quantum_arcsec {
        Some(quantum) => writeln!(out, "{:<31} {quantum:.6} arcsec", "increments are counts of")?,
        None => writeln!(out, "{:<31} no common count is seen", "increments")?,
    }
    writeln!(out, "\nSettings that follow:\n\n{}", settings.to_toml())
}

//! `north characterise`: a gyro's noise and the settings that follow from it.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::campaign::doubt_of_clock;
use crate::characterise::{self, Channels, Character, Point, Suggested, digits};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::output::{self, JsonOption};
use crate::progress;
use crate::report::{self, ReportOption};

/// Noise of a gyro from a still recording: Allan deviation, what it is made of, and the settings that follow
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north characterise still.csv --settings-out unit-7-settings.toml --report unit-7.html

The recording is a run (docs/formats.md) in which the index never moves: an hour or more, at the final temperature, on
firm ground. What its channels do to the rate is learned from its first half and shown beside the Allan deviation; for the
model: `north diagnose` on a campaign of still recordings.")]
pub struct Characterise {
    /// A run as a CSV file with t_s, index_deg and fog_arcsec
    #[arg(value_name = "FILE.csv")]
    recording: PathBuf,
    /// Write the settings that follow, as a file for `--settings`
    #[arg(long, value_name = "FILE")]
    settings_out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    json: JsonOption,
}

/// Averaging times that agree within this share are the same.
const SAME_TIME: f64 = 0.01;

#[derive(Serialize)]
struct Result {
    #[serde(flatten)]
    character: Character,
    settings: Suggested,
    channels: Option<Channels>,
}

impl Characterise {
    pub fn run(self) -> std::result::Result<(), Failure> {
        let results = [self.settings_out.as_deref(), self.report.path(), self.json.path()];
        output::check_beside([self.recording.as_path()], results)?;
        let character = Character::of(&characterise::read(&self.recording)?);
        let settings = character.suggested();
        let recording = self.recording.clone();
        let channels = progress::work("what the channels do".into(), move || characterise::of_channels(&recording))??;
        write(&mut self.json.human(), &character, channels.as_ref(), &settings)?;
        if let Some(path) = &self.settings_out {
            output::write(path, settings.to_toml()).map_err(|error| FileError::whole(path, error))?;
        }
        self.report.write(|| report::characterise::html(&self.recording, &character, channels.as_ref(), &settings))?;
        for doubt in doubts(&character, &settings) {
            output::warn(format_args!("{}: {doubt}", self.recording.display()));
        }
        self.json.write(&Result { character, settings, channels })
    }
}

/// What is doubtful about the recording, or about what follows from it.
fn doubts(character: &Character, settings: &Suggested) -> Vec<String> {
    let beyond = settings.beyond.iter().map(|beyond| format!("{beyond}: is the column the gyro's, and in arcsec?"));
    let of_clock = doubt_of_clock(character.interval_s, character.seconds);
    let of_length = character.doubt_of_length();
    of_clock.into_iter().chain(of_length).chain(characterise::told(&character.outliers)).chain(beyond).collect()
}

fn write(
    out: &mut dyn Write,
    character: &Character,
    channels: Option<&Channels>,
    settings: &Suggested,
) -> io::Result<()> {
    writeln!(
        out,
        "{:.0} s at {} s a row; mean rate {:+.4} °/h\n\n   averaging   Allan deviation{}",
        character.seconds,
        character.interval_s,
        character.mean_deg_h,
        if channels.is_some() { "             of the channels     without them" } else { "" }
    )?;
    for point in &character.allan {
        let at = |points: &[Point]| {
            let same = points.iter().find(|each| (each.tau_s / point.tau_s - 1.0).abs() < SAME_TIME);
            same.map_or_else(String::new, |each| format!("{:.6} °/h", each.sigma_deg_h))
        };
        let beside = channels.map_or_else(String::new, |channels| {
            format!("   {:>16}    {:>16}", at(&channels.part), at(&channels.left))
        });
        let deviation = format!("{:.6} °/h ± {:.0} %", point.sigma_deg_h, 100.0 * point.relative);
        writeln!(out, "{:10.4} s   {:<22}{beside}", point.tau_s, deviation)?;
    }
    if let Some(channels) = channels {
        writeln!(
            out,
            "\nchannels, learned from the first half: {}\nrate about its mean in the second half {:.4} °/h rms, {:.4} °/h without what the channels do",
            channels.effects.join(", "),
            channels.rate_rms_before_deg_h,
            channels.rate_rms_after_deg_h
        )?;
    }
    let below = format!("; it is below {} °/h", digits(character.greatest_instability_deg_h()));
    writeln!(out)?;
    for ((name, letter, unit), value) in characterise::PROCESSES.iter().zip(character.noise.coefficients()) {
        let beside = if *letter == "B" { below.as_str() } else { "" };
        let name = format!("{name}, {letter}");
        match value > 0.0 {
            true => writeln!(out, "{name:<31} {} {unit}", digits(value))?,
            false => writeln!(out, "{name:<31} not seen in this recording{beside}")?,
        }
    }
    let (correlation, sigma) = (character.autocorrelation_1s, character.autocorrelation_sigma);
    let verdict = character.correlation_verdict();
    writeln!(out, "{:<31} {correlation:+.3} ± {sigma:.3}: {verdict}", "correlation of 1 s rates")?;
    match character.quantum_arcsec {
        Some(quantum) => writeln!(out, "{:<31} {quantum:.6} arcsec", "increments are counts of")?,
        None => writeln!(out, "{:<31} no common count is seen", "increments")?,
    }
    writeln!(out, "\nSettings that follow:\n\n{}", settings.to_toml())
}

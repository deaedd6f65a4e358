//! `north import`: foreign recordings to campaigns.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::count::counted;
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::import::{self, Format, Map, Summary};
use crate::interrupt;
use crate::output::{self, JsonOption};
use crate::progress;

/// Turn a foreign recording into a campaign
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north import --map psins-lasergyro.toml lasergyro.imu --out parked-vehicle
  north import --map kvh-1775.toml --format kvh night.bin --out night
  north import --map psins-counts-csv.toml increments_100hz.csv --block parked.csv
  north import --guess strange.csv > strange.toml

Mappings: docs/import.md")]
pub struct Import {
    /// The recording
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// What its columns are, and which runs to cut from it
    #[arg(long, value_name = "MAP.toml", required_unless_present = "guess", conflicts_with = "guess")]
    map: Option<PathBuf>,
    /// Propose a mapping for the recording, to edit, on stdout; nothing is imported
    #[arg(long)]
    guess: bool,
    /// Latitude for the proposal, degrees, north positive, -90 to 90
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, requires = "guess", value_parser = super::number::<-90, 90>)]
    latitude: Option<f64>,
    /// Folder of the new campaign; it must not have anything in it
    #[arg(long, value_name = "DIR", required_unless_present_any = ["guess", "block"], conflicts_with = "guess")]
    out: Option<PathBuf>,
    /// Instead of a campaign: a new recording of a three-axis block, for `north align` and `north track`
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["guess", "out"])]
    block: Option<PathBuf>,
    /// How the recording is written
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    json: JsonOption,
}

impl Import {
    pub fn run(self) -> Result<(), Failure> {
        // A mapping is there unless one is to be proposed, and one of the two places: the command line asks for them.
        let (Some(map), Some(out)) = (&self.map, self.block.as_ref().or(self.out.as_ref())) else {
            if self.json.is_asked_for() {
                return Err(Failure::Usage(
                    "--json cannot be used with --guess, whose proposal is TOML on stdout".into(),
                ));
            }
            let proposal = import::guess(&self.recording, self.latitude)?;
            return Ok(std::io::stdout().write_all(proposal.as_bytes())?);
        };
        output::check_beside([self.recording.as_path(), map.as_path()], [self.block.as_deref(), self.json.path()])?;
        let map = Map::read(map)?;
        let bytes = fs::metadata(&self.recording).map_err(|error| FileError::whole(&self.recording, error))?.len();
        let bar = progress::bar(bytes, "bytes");
        let import = if self.block.is_some() { import::block } else { import::import };
        let summary = import(&map, &self.recording, self.format, out, &mut |read| {
            bar.set_position(read);
            !interrupt::requested()
        });
        bar.finish_and_clear();
        let summary = summary?;
        self.print(&summary, out, &mut self.json.human())?;
        for note in &summary.notes {
            eprintln!("north: note: {note}");
        }
        for doubt in &summary.doubts {
            output::warn(doubt);
        }
        self.json.write(&summary)
    }

    fn print(&self, summary: &Summary, folder: &Path, out: &mut dyn Write) -> std::io::Result<()> {
        for run in &summary.runs {
            let rows = counted(run.rows, "row");
            writeln!(out, "{}: {rows}, {:.3} s from {:.3} s on", run.file, run.seconds, run.start_s)?;
        }
        let losses = &summary.losses;
        let what =
            if self.block.is_some() { "recording of a block".to_owned() } else { counted(summary.runs.len(), "run") };
        write!(
            out,
            "{}: {what} from {}, {} lost, {} not valid",
            folder.display(),
            counted(summary.samples, "sample"),
            losses.lost_samples,
            losses.invalid_samples
        )?;
        if self.format == Format::Kvh {
            let sums = counted(losses.bad_frames, "bad check sum");
            write!(out, ", {sums}, {} skipped", counted(losses.skipped_bytes, "byte"))?;
        }
        if let Some(rate_hz) = summary.measured_rate_hz {
            write!(out, "; {rate_hz:.3} Hz")?;
        }
        writeln!(out)
    }
}

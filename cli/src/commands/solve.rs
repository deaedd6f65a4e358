//! `north solve`: azimuths of recorded runs.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use north_finder::earth::earth_rate;
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::number;
use crate::campaign::{Campaign, Run, RunReader};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::interrupt;
use crate::json::{Run as RunRecord, Solved};
use crate::model_file::ModelFile;
use crate::output::{self, JsonOption};
use crate::present::{Directions, Reference};
use crate::progress;
use crate::report::certificate::Made;
use crate::report::fix::Shown;
use crate::report::{self, ReportOption};
use crate::service::{Logged, write_log};
use crate::settings_file::campaign_settings;
use crate::solve::{Solution, SolveError, solve_file};

/// Solve the runs of a campaign, or one bare run, for their azimuths
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north solve acceptance-unit-7 --report unit-7.html
  north solve run.csv --latitude 34.75 --model unit-7.toml --json -")]
pub struct Solve {
    /// A campaign (its folder or its campaign.toml), or a run as a CSV file
    #[arg(value_name = "CAMPAIGN-OR-CSV")]
    path: PathBuf,
    /// Error model of the gyro, from a calibration
    #[arg(long, value_name = "M.toml")]
    model: Option<PathBuf>,
    /// Latitude, degrees, north positive, -90 to 90: needed for a bare run; a campaign's own is not used then
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-90, 90>)]
    latitude: Option<f64>,
    /// Settings (declared noise, thresholds), laid over the defaults
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    /// Write the fixes as a log, for `north watch`; every run counts as begun with a switch-on
    #[arg(long, value_name = "LOG.csv")]
    log: Option<PathBuf>,
    #[command(flatten)]
    directions: Directions,
    #[command(flatten)]
    report: ReportOption,
    /// Write a certificate of the azimuth: one page to print; of a single run
    #[arg(long, value_name = "C.html")]
    certificate: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// A run and what became of it.
struct Solvable<'a> {
    run: &'a Run,
    latitude_deg: f64,
    solved: Result<Solution, SolveError>,
}

impl Solve {
    pub fn run(self) -> Result<(), Failure> {
        let campaign = self.campaign()?;
        self.check_results(&campaign)?;
        if self.certificate.is_some() && campaign.runs.len() != 1 {
            let why =
                format!("--certificate is of a single run, and {} has {}", self.path.display(), campaign.runs.len());
            return Err(Failure::Usage(why));
        }
        let base = campaign_settings(&campaign, self.settings.as_deref())?;
        let model = self.model.as_deref().map(ModelFile::read).transpose()?;
        let bar = progress::bar(campaign.runs.len() as u64, "runs");
        let facts = campaign.facts();
        let runs: Vec<_> = campaign
            .runs
            .par_iter()
            .zip(&facts)
            .take_any_while(|_| !interrupt::requested())
            .map(|(run, facts)| {
                let latitude_deg = self.latitude.or(campaign.latitude_of(run)).unwrap_or(base.latitude_deg);
                let mut settings = Settings { latitude_deg, ..base.clone() };
                let applied = model.as_ref().map_or(Ok(()), |model| model.apply(&mut settings));
                let solved = applied
                    .map_err(SolveError::from)
                    .and_then(|()| solve_file(&campaign.path_of(run), &settings, *facts));
                bar.inc(1);
                Solvable { run, latitude_deg, solved }
            })
            .collect();
        bar.finish_and_clear();
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        let out = &mut self.json.human();
        for note in model.iter().flat_map(ModelFile::notes) {
            writeln!(out, "note: {note}")?;
        }
        write_table(out, &runs, &self.directions)?;
        warn_of_tilted(&runs, base.level.limit_deg);
        if let Some(path) = &self.log {
            write_log(path, &logged(&campaign, &runs)?)?;
        }
        self.draw(&campaign, &runs)?;
        self.json.write(&Solved { runs: runs.iter().map(|each| each.record(&self.directions)).collect() })?;
        refuse(&runs)
    }

    /// Whether the results can be written, over none of the files that are read.
    fn check_results(&self, campaign: &Campaign) -> Result<(), FileError> {
        let results = [self.log.as_deref(), self.report.path(), self.certificate.as_deref(), self.json.path()];
        let named = [&self.model, &self.settings].into_iter().flatten().cloned();
        let read: Vec<PathBuf> = named.chain(campaign.files(&self.path)).collect();
        output::check_beside(read.iter().map(PathBuf::as_path), results)
    }

    /// The pages that were asked for.
    fn draw(&self, campaign: &Campaign, runs: &[Solvable<'_>]) -> Result<(), Failure> {
        let shown: Vec<Shown<'_>> = runs.iter().filter_map(Solvable::shown).collect();
        let refused: Vec<(String, String)> = runs
            .iter()
            .filter_map(|each| Some((each.run.file.clone(), each.solved.as_ref().err()?.to_string())))
            .collect();
        let title = format!("Azimuths: {}", campaign.title.as_deref().unwrap_or(&self.path.display().to_string()));
        self.report.write(|| report::fix::all(&title, &shown, &refused, &self.directions))?;
        let ([shown], [run]) = (shown.as_slice(), runs) else { return Ok(()) };
        let instrument = [("recording", self.path.display().to_string()), ("run", run.run.file.clone())];
        let made = Made { instrument: &instrument, latitude_deg: run.latitude_deg, simulated: false };
        report::write(self.certificate.as_deref(), || report::certificate::html(shown, &made, &self.directions))
    }

    fn campaign(&self) -> Result<Campaign, Failure> {
        let is_campaign = self.path.is_dir() || self.path.extension().is_some_and(|extension| extension == "toml");
        match self.latitude {
            latitude_deg if is_campaign => Ok(Campaign::read_at(&self.path, latitude_deg)?),
            Some(latitude_deg) => Ok(Campaign::of_bare_run(&self.path, latitude_deg)),
            None => {
                // A file that is not there, or no run, is said first.
                RunReader::open(&self.path)?;
                Err(Failure::Usage(format!(
                    "{} is not a campaign: the latitude of a bare run must be given with --latitude",
                    self.path.display()
                )))
            }
        }
    }
}

/// Which runs stood so inclined that a board would not have begun to measure.
fn warn_of_tilted(runs: &[Solvable<'_>], limit_deg: f64) {
    let tilted = |each: &&Solvable<'_>| {
        each.solved.as_ref().is_ok_and(|solved| solved.fix.tilt.is_some_and(|tilt| !tilt.is_level(limit_deg)))
    };
    let names: Vec<&str> = runs.iter().filter(tilted).map(|each| each.run.file.as_str()).collect();
    if let [first, others @ ..] = names.as_slice() {
        let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
        output::warn(format_args!(
            "{first}{more} stood inclined by more than level.limit_deg = {limit_deg}: a board would have waited for a level base"
        ));
    }
}

/// The fixes of the runs that have one.
fn logged(campaign: &Campaign, runs: &[Solvable<'_>]) -> Result<Vec<Logged>, Failure> {
    let solved = (1..).zip(runs).filter_map(|(number, each)| Some((number, each, each.solved.as_ref().ok()?)));
    solved
        .map(|(number, each, solution)| {
            let temp_c = mean_temperature_c(&campaign.path_of(each.run))?;
            Ok(Logged::of_run(number, each.run, &solution.fix, temp_c))
        })
        .collect()
}

/// Mean over a run's rows, where it has temperatures.
fn mean_temperature_c(run: &Path) -> Result<Option<f64>, Failure> {
    let (mut sum, mut count) = (0.0, 0.0);
    for row in RunReader::open(run)? {
        if let Some(temp_c) = row?.temp_c {
            (sum, count) = (sum + temp_c, count + 1.0);
        }
    }
    Ok((count > 0.0).then(|| sum / count))
}

impl Solvable<'_> {
    /// For the pages, where there is an azimuth.
    fn shown(&self) -> Option<Shown<'_>> {
        let Solution { fix, dwells } = self.solved.as_ref().ok()?;
        let reference = self.run.reference_azimuth_deg.map(|azimuth_deg| Reference { name: "reference", azimuth_deg });
        Some(Shown { name: &self.run.file, fix, dwells, earth: earth_rate(self.latitude_deg).ok(), reference })
    }

    fn record(&self, directions: &Directions) -> RunRecord {
        let file = self.run.file.clone();
        let mut record = match &self.solved {
            Ok(Solution { fix, dwells }) => RunRecord::of_fix(file, fix, dwells),
            Err(error) => RunRecord::without_azimuth(file, &[], None, Some(error.to_string())),
        };
        if let Some(reference_azimuth_deg) = self.run.reference_azimuth_deg {
            record.compare(reference_azimuth_deg);
        }
        record.ask(directions);
        record
    }

    /// Azimuth minus reference and the same in sigmas, where there is a reference.
    fn error(&self) -> Option<(f64, f64)> {
        let fix = self.solved.as_ref().ok()?.fix;
        let error_deg = wrap_180_deg(fix.azimuth_deg - self.run.reference_azimuth_deg?);
        Some((error_deg, error_deg.abs() / fix.sigma_deg))
    }
}

fn write_table(out: &mut dyn Write, runs: &[Solvable<'_>], directions: &Directions) -> io::Result<()> {
    let width = runs.iter().map(|each| each.run.file.chars().count()).max().unwrap_or_default().max(4);
    let with_reference = runs.iter().any(|each| each.run.reference_azimuth_deg.is_some());
    let error_head = if with_reference { "     error (sigma)" } else { "" };
    writeln!(out, "{:<width$}    azimuth      sigma    closure{error_head}  flags", "run")?;
    writeln!(out, "{:<width$}        deg        deg      deg/h{}", "", if with_reference { "       deg" } else { "" })?;
    for each in runs {
        write!(out, "{:<width$}", each.run.file)?;
        match &each.solved {
            Ok(solution) => write_row(out, each, solution, with_reference)?,
            Err(SolveError::NoChannel { channel, .. }) => {
                writeln!(out, "  refused: the model follows channel `{channel}`, which is not recorded")?;
            }
            Err(SolveError::NotStarted { fact, .. }) => {
                writeln!(out, "  refused: the model follows the {fact}, and it is not known when the run started")?;
            }
            Err(SolveError::File(_)) => writeln!(out, "  refused: the file is wrong, see below")?,
            Err(SolveError::Refused { refusal, .. }) => writeln!(out, "  refused: {refusal}")?,
        }
    }
    let errors: Vec<f64> = runs.iter().filter_map(|each| each.error().map(|(error_deg, _)| error_deg)).collect();
    if errors.len() > 1 {
        let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        writeln!(out, "{} runs with a reference: error {rms:.4} deg rms", errors.len())?;
    }
    for each in runs {
        if let Ok(Solution { fix, .. }) = &each.solved
            && directions.asked(fix.azimuth_deg, fix.sigma_deg).is_some()
        {
            writeln!(out, "\n{}", each.run.file)?;
            directions.write(out, fix.azimuth_deg, fix.sigma_deg)?;
        }
    }
    Ok(())
}

fn write_row(out: &mut dyn Write, each: &Solvable<'_>, solution: &Solution, with_reference: bool) -> io::Result<()> {
    let fix = &solution.fix;
    let closure = fix.closure_deg_h.map_or("-".into(), |closure| format!("{closure:+.5}"));
    write!(out, "  {:9.4}  {:9.4}  {closure:>9}", fix.azimuth_deg, fix.sigma_deg)?;
    if with_reference {
        let error = each.error().map_or("-".into(), |(error_deg, sigmas)| format!("{error_deg:+.4} ({sigmas:5.1})"));
        write!(out, "  {error:>16}")?;
    }
    let flags: Vec<_> = fix.flags.iter().map(|flag| flag.name()).collect();
    writeln!(out, "  {}", if flags.is_empty() { "-".into() } else { flags.join(" ") })
}

/// An error if any run was refused; every reason goes to stderr.
fn refuse(runs: &[Solvable<'_>]) -> Result<(), Failure> {
    let reasons: Vec<_> = runs.iter().filter_map(|each| each.solved.as_ref().err().map(ToString::to_string)).collect();
    match reasons.as_slice() {
        [] => Ok(()),
        [reason] if runs.len() == 1 => Err(Failure::Refused(reason.clone())),
        reasons => Err(Failure::Refused(format!(
            "{}\nnorth: {} of {} runs refused",
            reasons.join("\nnorth: "),
            reasons.len(),
            runs.len()
        ))),
    }
}

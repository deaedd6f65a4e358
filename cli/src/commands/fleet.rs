//! `north fleet`: what the instruments of one type have in common.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use learn::Family;
use serde::Serialize;

use crate::count::counted;
use crate::diagnose::median;
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::fleet::{self, Fleet, Outcome, report, sources};
use crate::output::JsonOption;
use crate::{interrupt, progress};

/// What the instruments of one type have in common, and which of them are not like the others
#[derive(Args, Debug)]
pub struct FleetCommand {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    Learn(Learn),
    Show(Show),
    Diagnose(DiagnoseAll),
}

/// Learn which effects the units share and how these differ from unit to unit: a prior for "north diagnose --fleet"
///
/// Units are campaigns (folders with a campaign.toml) or model files of "north diagnose --model-out"; a folder stands for all of them in it. All are of one
/// type. Campaigns tell more than models: what no single unit is certain of may be certain of all together.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  north fleet learn campaigns --out type-a.toml && north diagnose unit-51 --fleet type-a.toml"
)]
struct Learn {
    /// Campaigns, model files, or folders of them
    #[arg(value_name = "DIR", required = true)]
    units: Vec<PathBuf>,
    /// The file to write
    #[arg(long, value_name = "F.toml")]
    out: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    json: JsonOption,
}

/// Show what a fleet has in common, and the units that are out of the family
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north fleet show type-a.toml --report type-a.html")]
struct Show {
    /// What "north fleet learn" wrote
    #[arg(value_name = "F.toml")]
    fleet: PathBuf,
    /// Write a report to look at: one HTML file that fetches nothing
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// Diagnose many campaigns, one on each thread; what is done is not done again
///
/// For every campaign NAME the folder of results has NAME.json (what "north diagnose --json" gives, or {"refused": why}) and NAME.toml (its model). A
/// campaign whose diagnosis is there is left as it is, and one that was refused is tried again: after an interrupt the same command goes on. Memory is
/// that of as many campaigns as there are threads.
#[derive(Args, Debug)]
#[command(
    name = "diagnose",
    after_help = "Example:\n  north fleet diagnose campaigns --results results --fleet type-a.toml --table results.parquet"
)]
struct DiagnoseAll {
    /// Campaigns, or folders of them
    #[arg(value_name = "DIR", required = true)]
    campaigns: Vec<PathBuf>,
    /// The folder of results, not that of the campaigns
    #[arg(long, value_name = "DIR")]
    results: PathBuf,
    /// What the instruments of their type have in common
    #[arg(long, value_name = "F.toml")]
    fleet: Option<PathBuf>,
    /// Write all results as one Parquet table: a row for every campaign
    #[arg(long, value_name = "T.parquet")]
    table: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    json: JsonOption,
}

/// How many at a time.
#[derive(Args, Clone, Copy, Debug)]
struct Threads {
    /// Campaigns at a time; all threads of the machine if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Threads {
    fn count(self) -> usize {
        self.threads.map_or_else(fleet::cores, usize::from)
    }
}

impl FleetCommand {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Learn(learn) => learn.run(),
            What::Show(show) => show.run(),
            What::Diagnose(diagnose) => diagnose.run(),
        }
    }
}

impl Learn {
    fn run(self) -> Result<(), Failure> {
        crate::output::check([Some(self.out.as_path()), self.json.path()])?;
        let units = sources(&self.units)?;
        let (bar, threads) = (progress::bar(2 * units.len() as u64, "readings of units"), self.threads.count());
        let (shown, stop) = (bar.clone(), interrupt::flag());
        let work = move || fleet::learn(&units, threads, stop, || shown.inc(1));
        let learned = progress::interruptible(work, || bar.tick())??;
        bar.finish_and_clear();
        learned.write(&self.out)?;
        report::write(&mut self.json.human(), &learned)?;
        self.json.write(&learned)
    }
}

impl Show {
    fn run(self) -> Result<(), Failure> {
        crate::output::check_beside([self.fleet.as_path()], [self.report.as_deref(), self.json.path()])?;
        let fleet = Fleet::read(&self.fleet)?;
        report::write(&mut self.json.human(), &fleet)?;
        if let Some(path) = &self.report {
            let title = self.fleet.file_stem().map_or("Fleet".into(), |name| name.to_string_lossy());
            let page = report::html(&fleet, &format!("{title}: what the units have in common"));
            crate::output::write(path, page).map_err(|error| FileError::whole(path, error))?;
        }
        self.json.write(&fleet)
    }
}

/// What became of the campaigns.
#[derive(Serialize)]
struct Summary {
    campaigns: usize,
    /// Of them those whose results were there, and those that cannot be diagnosed.
    known: usize,
    refused: usize,
    /// Time of one diagnosis on one thread, median of those made now.
    seconds: Option<f64>,
}

impl DiagnoseAll {
    fn run(self) -> Result<(), Failure> {
        crate::output::check_beside(self.fleet.as_deref(), [self.table.as_deref(), self.json.path()])?;
        let family = family(self.fleet.as_deref())?;
        let jobs = fleet::jobs(&sources(&self.campaigns)?, &self.results, self.fleet.as_deref())?;
        let (bar, threads) = (progress::bar(jobs.len() as u64, "campaigns"), self.threads.count());
        let (shown, all, stop) = (bar.clone(), jobs.clone(), interrupt::flag());
        let work = move || fleet::diagnose_all(&all, &family, threads, stop, || shown.inc(1));
        let outcomes = progress::interruptible(work, || bar.tick())??;
        bar.finish_and_clear();
        if let Some(path) = &self.table {
            fleet::write_table(&jobs, path)?;
        }
        let count = |which: Outcome| outcomes.iter().filter(|outcome| **outcome == which).count();
        let times: Vec<f64> = outcomes
            .iter()
            .filter_map(|outcome| match outcome {
                Outcome::Done { seconds } => Some(*seconds),
                _ => None,
            })
            .collect();
        let summary = Summary {
            campaigns: jobs.len(),
            known: count(Outcome::Known),
            refused: count(Outcome::Refused),
            seconds: (!times.is_empty()).then(|| median(times)),
        };
        let mut out = self.json.human();
        writeln!(
            out,
            "{}: {} done before, {} cannot be diagnosed (why is in their results)",
            counted(summary.campaigns, "campaign"),
            summary.known,
            summary.refused
        )?;
        if let Some(seconds) = summary.seconds {
            writeln!(out, "{seconds:.1} s for one on one thread (median), {threads} at a time")?;
        }
        self.json.write(&summary)
    }
}

/// The prior of a fleet's file; nothing without one.
pub fn family(fleet: Option<&Path>) -> Result<Family, FileError> {
    fleet.map_or_else(|| Ok(Family::default()), |path| Ok(Fleet::read(path)?.family()))
}

//! The diagnosis of many campaigns: a map over folders whose results are files, so that what is done is not done again.
//!
//! Beside each other in the folder of results: `NAME.json`, the diagnosis, or why there is none; `NAME.toml`, the model; `made-with.json`, what all of
//! them were made with.

use std::fmt::{self, Display};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use learn::Family;
use serde::{Deserialize, Serialize};

use super::map::map;
use super::unit::{Source, campaign};
use crate::diagnose::diagnose;
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::output;
use crate::parquet_table::ParquetTable;
use crate::settings_file::model_text;

const MADE_WITH: &str = "made-with.json";

/// A campaign and where its results are.
#[derive(Clone, Debug)]
pub struct Job {
    pub name: String,
    campaign: PathBuf,
    result: PathBuf,
    model: PathBuf,
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Its results were there.
    Known,
    /// In so many seconds.
    Done { seconds: f64 },
    /// The campaign cannot be diagnosed: why is in its result.
    Refused,
}

/// What all results of a folder were made with.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MadeWith {
    version: String,
    /// CRC-32 of the fleet's file.
    fleet_crc32: Option<u32>,
}

impl Display for MadeWith {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "version {} with ", self.version)?;
        match self.fleet_crc32 {
            Some(crc32) => write!(f, "a fleet of CRC-32 {crc32:08x}"),
            None => write!(f, "no fleet"),
        }
    }
}

/// The result of a campaign that cannot be diagnosed.
#[derive(Serialize)]
struct NoDiagnosis<'a> {
    refused: &'a str,
}

/// The jobs of some campaigns, whose results go to a folder; `fleet` is the file of the prior.
///
/// Errors: a source that is no campaign, or one whose results have no name of their own; a folder that holds the campaigns themselves, that cannot be
/// made, or whose results were made with something else.
pub fn jobs(sources: &[Source], results: &Path, fleet: Option<&Path>) -> Result<Vec<Job>, Failure> {
    let job = |source: &Source| match source {
        Source::Campaign(path) => {
            let name = source.name();
            if format!("{name}.json") == MADE_WITH {
                let text =
                    format!("a campaign of this name has no results: {MADE_WITH} says what all of them were made with");
                return Err(FileError::whole(path, Problem::Syntax(text)).into());
            }
            let file = |ending: &str| results.join(format!("{name}.{ending}"));
            Ok(Job { campaign: path.clone(), result: file("json"), model: file("toml"), name })
        }
        Source::Model(path) => {
            let problem = Problem::Syntax("a model file is no campaign, and cannot be diagnosed".into());
            Err(FileError::whole(path, problem).into())
        }
    };
    let jobs = sources.iter().map(job).collect::<Result<Vec<Job>, Failure>>()?;
    std::fs::create_dir_all(results).map_err(|error| FileError::whole(results, error))?;
    let folder = results.canonicalize().map_err(|error| FileError::whole(results, error))?;
    let among = |job: &Job| {
        let parent = job.campaign.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        parent.canonicalize().is_ok_and(|parent| parent == folder)
    };
    if jobs.iter().any(among) {
        let text = "the campaigns are in this folder, and models beside them would be units, too; take a folder of their own for the results";
        return Err(FileError::whole(results, Problem::Syntax(text.into())).into());
    }
    check_made_with(results, fleet)?;
    Ok(jobs)
}

/// Results in one folder were all made with the same.
fn check_made_with(results: &Path, fleet: Option<&Path>) -> Result<(), Failure> {
    let bytes = fleet.map(|path| std::fs::read(path).map_err(|error| FileError::whole(path, error))).transpose()?;
    let fleet_crc32 = bytes.map(|bytes| north_boot::CRC_32.checksum(&bytes));
    let now = MadeWith { version: env!("CARGO_PKG_VERSION").into(), fleet_crc32 };
    let path = results.join(MADE_WITH);
    if path.exists() {
        let text = std::fs::read_to_string(&path).map_err(|error| FileError::whole(&path, error))?;
        let before: MadeWith =
            serde_json::from_str(&text).map_err(|error| FileError::whole(&path, Problem::Syntax(error.to_string())))?;
        if before != now {
            let text = format!(
                "the results in this folder were made with another version or another fleet ({before}; now {now}); take a folder of their own for new ones"
            );
            return Err(FileError::whole(&path, Problem::Syntax(text)).into());
        }
        return Ok(());
    }
    let text = serde_json::to_string(&now).map_err(std::io::Error::from)?;
    Ok(replace(&path, &text)?)
}

/// Diagnoses what is not diagnosed yet, each campaign on one of so many threads. `stop` is the flag of an interrupt, `done` is called after each.
///
/// Errors: results that cannot be written, an interrupt. What is done stays done.
pub fn diagnose_all(
    jobs: &[Job],
    family: &Family,
    threads: usize,
    stop: &AtomicBool,
    done: impl Fn() + Sync,
) -> Result<Vec<Outcome>, Failure> {
    let work = |job: &Job| {
        let outcome = job.run(family);
        done();
        outcome
    };
    map(jobs, threads, stop, work)?.into_iter().collect()
}

impl Job {
    /// A refusal that is there is no result: what it complains of may have been mended.
    fn run(&self, family: &Family) -> Result<Outcome, Failure> {
        if self.result.exists() && Row::read(self)?.refused.is_empty() {
            return Ok(Outcome::Known);
        }
        let begun = Instant::now();
        let (campaign, mut options) = match campaign(&self.campaign) {
            Ok(read) => read,
            Err(Failure::Interrupted) => return Err(Failure::Interrupted),
            Err(failure) => return self.refuse(&failure),
        };
        options.family = family.clone();
        match diagnose(&campaign, &options) {
            Ok(diagnosis) => {
                let model = model_text(&diagnosis.model).map_err(std::io::Error::other)?;
                replace(&self.model, &model)?;
                // Last: where it is, everything is.
                replace(&self.result, &json(&diagnosis)?)?;
                Ok(Outcome::Done { seconds: begun.elapsed().as_secs_f64() })
            }
            Err(refusal) => self.refuse(&refusal),
        }
    }

    fn refuse(&self, why: &impl Display) -> Result<Outcome, Failure> {
        replace(&self.result, &json(&NoDiagnosis { refused: &why.to_string() })?)?;
        Ok(Outcome::Refused)
    }
}

fn json(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string(value).map(|text| text + "\n").map_err(std::io::Error::from)?)
}

/// A file that appears as a whole, in the place of half a one that an interrupt may have left.
fn replace(path: &Path, text: &str) -> Result<(), FileError> {
    let write = || {
        let mut file = output::replace(path)?;
        file.write_all(text.as_bytes())?;
        file.finish()
    };
    write().map_err(|error| FileError::whole(path, error))
}

/// One campaign in the table of results.
#[derive(Clone, Debug, Default)]
struct Row {
    campaign: String,
    instrument: String,
    /// Names of the effects, with a comma between them.
    effects: String,
    /// Why there is no diagnosis; empty where there is one.
    refused: String,
    runs: Option<f64>,
    judged_runs: Option<f64>,
    azimuth_rms_before_deg: Option<f64>,
    azimuth_rms_after_deg: Option<f64>,
    azimuth_rms_board_deg: Option<f64>,
    residual_rms_before_deg_h: Option<f64>,
    residual_rms_after_deg_h: Option<f64>,
    /// 1 where structure remains that no candidate explains.
    unexplained: Option<f64>,
    /// Probability that the unit is out of its family.
    outside: Option<f64>,
}

/// Columns of numbers.
const NUMBERS: [&str; 9] = [
    "runs",
    "judged_runs",
    "azimuth_rms_before_deg",
    "azimuth_rms_after_deg",
    "azimuth_rms_board_deg",
    "residual_rms_before_deg_h",
    "residual_rms_after_deg_h",
    "unexplained",
    "outside",
];

impl Row {
    /// Of a result as it is on the disk.
    fn read(job: &Job) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(&job.result).map_err(|error| FileError::whole(&job.result, error))?;
        let result: serde_json::Value = serde_json::from_str(&text)
            .map_err(|error| FileError::whole(&job.result, Problem::Syntax(error.to_string())))?;
        let text = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
        let number = |name: &str| result[name].as_f64();
        let effects = result["effects"].as_array().into_iter().flatten();
        Ok(Self {
            campaign: job.name.clone(),
            instrument: text(&result["origin"]["instrument"]),
            effects: effects.map(|effect| text(&effect["name"])).collect::<Vec<_>>().join(","),
            refused: text(&result["refused"]),
            runs: result["runs"].as_array().map(|runs| runs.len() as f64),
            judged_runs: number("judged_runs"),
            azimuth_rms_before_deg: number("azimuth_rms_before_deg"),
            azimuth_rms_after_deg: number("azimuth_rms_after_deg"),
            azimuth_rms_board_deg: number("azimuth_rms_board_deg"),
            residual_rms_before_deg_h: number("residual_rms_before_deg_h"),
            residual_rms_after_deg_h: number("residual_rms_after_deg_h"),
            unexplained: result["unexplained"].as_bool().map(|is| f64::from(u8::from(is))),
            outside: result["family"]["outside"].as_f64(),
        })
    }

    fn texts(&self) -> [&str; 4] {
        [&self.campaign, &self.instrument, &self.effects, &self.refused]
    }

    fn numbers(&self) -> [Option<f64>; 9] {
        [
            self.runs,
            self.judged_runs,
            self.azimuth_rms_before_deg,
            self.azimuth_rms_after_deg,
            self.azimuth_rms_board_deg,
            self.residual_rms_before_deg_h,
            self.residual_rms_after_deg_h,
            self.unexplained,
            self.outside,
        ]
    }
}

/// Writes the results of all jobs as a Parquet table: a row for every campaign, in their order. One is in memory at a time.
pub fn write_table(jobs: &[Job], path: &Path) -> Result<u64, Failure> {
    let texts = ["campaign", "instrument", "effects", "refused"];
    let mut table = ParquetTable::create(path, "diagnoses", &texts, NUMBERS.into_iter())?;
    for job in jobs {
        let row = Row::read(job)?;
        table.push(row.texts(), row.numbers())?;
    }
    table.finish()
}

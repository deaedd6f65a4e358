//! `campaign.toml`: what was recorded, where, and what is known of it.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use north_finder::effects::now::RunFacts;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use toml::Spanned;

use super::{MANIFEST, UNFINISHED};
use crate::file_error::{FileError, Problem};
use crate::toml_file::{self, TomlFile};

/// The format number of the files that this program reads and writes.
pub(super) const FORMAT: i64 = 1;

/// A campaign: runs of one instrument.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Campaign {
    /// Where the runs' files are.
    #[serde(skip)]
    pub folder: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Latitude of every run that does not give its own, degrees, north positive, −90 … 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument: Option<Instrument>,
    #[serde(rename = "run")]
    pub runs: Vec<Run>,
}

/// What is known of the gyro.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Instrument {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Angle random walk, °/√h, 0 … 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arw_deg_per_sqrt_h: Option<f64>,
    /// The settings that the instrument had, a file relative to the campaign's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settings: Option<String>,
}

/// One recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// The CSV file, relative to the campaign's folder.
    pub file: String,
    pub role: Role,
    /// Surveyed azimuth of the index-zero mark, degrees clockwise from true north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_azimuth_deg: Option<f64>,
    /// One sigma of the survey, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_sigma_deg: Option<f64>,
    /// Latitude of this run, degrees; overrides the campaign's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
    /// Runs of one station share one heading, known or not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub station: Option<String>,
    /// When it began, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<String>,
}

/// What a run may be used for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// May be learned from.
    Fit,
    /// Is only judged.
    #[default]
    Check,
}

impl Campaign {
    /// Reads a campaign by its folder or by its `campaign.toml`. The runs' files are not opened yet.
    ///
    /// Errors: no such file, not TOML, another format, unknown or missing keys, values out of range, a run without a
    /// latitude, a file listed twice.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::read_at(path, None)
    }

    /// The same, where another latitude than the file's is given: runs without their own have that one.
    pub fn read_at(path: &Path, latitude_deg: Option<f64>) -> Result<Self, FileError> {
        let (folder, manifest) = toml_file::locate(path, MANIFEST);
        if folder.join(UNFINISHED).is_file() && !manifest.exists() {
            return Err(FileError::whole(&folder, Problem::Unfinished));
        }
        if manifest.is_file() && manifest.extension().is_none_or(|extension| extension != "toml") {
            return Err(FileError::whole(&manifest, Problem::NoCampaign));
        }
        let file = TomlFile::read(&manifest)?;
        let raw: Raw = file.parse_format(FORMAT)?;
        raw.check(&file, folder, latitude_deg)
    }

    /// A bare run as a campaign of its own: no reference, one latitude.
    pub fn of_bare_run(file: &Path, latitude_deg: f64) -> Self {
        let run = Run { file: file.to_string_lossy().into_owned(), ..Run::default() };
        Self {
            folder: PathBuf::new(),
            title: None,
            latitude_deg: Some(latitude_deg),
            instrument: None,
            runs: vec![run],
        }
    }

    /// The file that describes the campaign that a path names; the path itself where it is that of a bare run.
    pub fn manifest_of(path: &Path) -> PathBuf {
        toml_file::locate(path, MANIFEST).1
    }

    /// The files that are read of the campaign that a path names: the one that describes it, those of its runs, and the instrument's settings.
    pub fn files(&self, path: &Path) -> Vec<PathBuf> {
        let settings = self.instrument.iter().filter_map(|instrument| instrument.settings.as_ref());
        let named = self.runs.iter().map(|run| self.path_of(run)).chain(settings.map(|file| self.folder.join(file)));
        std::iter::once(Self::manifest_of(path)).chain(named).collect()
    }

    /// The path of a run's file.
    pub fn path_of(&self, run: &Run) -> PathBuf {
        self.folder.join(&run.file)
    }

    /// The latitude that holds for a run, degrees.
    pub fn latitude_of(&self, run: &Run) -> Option<f64> {
        run.latitude_deg.or(self.latitude_deg)
    }

    /// When a run started, seconds of the common epoch, if that is known.
    pub fn start_s(&self, run: &Run) -> Option<f64> {
        Some(OffsetDateTime::parse(run.started.as_deref()?, &Rfc3339).ok()?.unix_timestamp() as f64)
    }

    /// What is known of every run as a whole: the time of day at its start, and the time since the start of the run before it. The instrument
    /// is taken to have rested a day before the first.
    pub fn facts(&self) -> Vec<RunFacts> {
        let starts: Vec<Option<f64>> = self.runs.iter().map(|run| self.start_s(run)).collect();
        let rest_s = |own_s: f64| {
            let before = starts.iter().flatten().filter(|other_s| **other_s < own_s).copied().max_by(f64::total_cmp);
            before.map_or(SECONDS_PER_DAY, |before_s| own_s - before_s)
        };
        let hour = |own_s: f64| (own_s / 3600.0).rem_euclid(24.0);
        starts.iter().map(|own_s| RunFacts { hour_of_day: own_s.map(hour), rest_s: own_s.map(rest_s) }).collect()
    }
}

const SECONDS_PER_DAY: f64 = 86_400.0;

impl Default for Run {
    fn default() -> Self {
        Self {
            file: String::new(),
            role: Role::Check,
            reference_azimuth_deg: None,
            reference_sigma_deg: None,
            latitude_deg: None,
            station: None,
            started: None,
        }
    }
}

/// The file as it stands, every value with its place.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    title: Option<String>,
    latitude_deg: Option<Spanned<f64>>,
    instrument: Option<RawInstrument>,
    #[serde(default)]
    run: Vec<Spanned<RawRun>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawInstrument {
    name: Option<String>,
    arw_deg_per_sqrt_h: Option<Spanned<f64>>,
    settings: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRun {
    file: Spanned<String>,
    #[serde(default)]
    role: Role,
    reference_azimuth_deg: Option<Spanned<f64>>,
    reference_sigma_deg: Option<Spanned<f64>>,
    latitude_deg: Option<Spanned<f64>>,
    station: Option<Spanned<String>>,
    started: Option<Spanned<String>>,
}

impl Raw {
    fn check(self, file: &TomlFile, folder: PathBuf, given_deg: Option<f64>) -> Result<Campaign, FileError> {
        if self.run.is_empty() {
            return Err(file.whole(Problem::Syntax("no [[run]] is listed; a campaign has at least one".into())));
        }
        let latitude_deg = check_range(file, "latitude_deg", self.latitude_deg, -90.0, 90.0)?.or(given_deg);
        let instrument = self.instrument.map(|raw| raw.check(file)).transpose()?;
        let mut seen = HashSet::new();
        let mut runs = Vec::with_capacity(self.run.len());
        for raw in self.run {
            let span = raw.span();
            let run = raw.into_inner().check(file, &mut seen)?;
            if latitude_deg.is_none() && run.latitude_deg.is_none() {
                let problem = "this run has no latitude_deg, and the campaign gives none for all";
                return Err(file.at(span, Problem::Syntax(problem.into())));
            }
            runs.push(run);
        }
        Ok(Campaign { folder, title: self.title, latitude_deg, instrument, runs })
    }
}

impl RawInstrument {
    fn check(self, file: &TomlFile) -> Result<Instrument, FileError> {
        let arw_deg_per_sqrt_h = check_range(file, "arw_deg_per_sqrt_h", self.arw_deg_per_sqrt_h, 0.0, 1.0)?;
        Ok(Instrument { name: self.name, arw_deg_per_sqrt_h, settings: self.settings })
    }
}

impl RawRun {
    fn check(self, file: &TomlFile, seen: &mut HashSet<String>) -> Result<Run, FileError> {
        let name_span = self.file.span();
        let name = self.file.into_inner();
        if name.is_empty() || Path::new(&name).is_absolute() {
            let problem = Problem::not_allowed(format!("file = {name}"), "a path relative to the campaign's folder");
            return Err(file.at(name_span, problem));
        }
        if !seen.insert(name.clone()) {
            return Err(file.at(name_span, Problem::not_allowed(format!("file = {name}"), "a file listed only once")));
        }
        let station = self.station.map(|station| check_station(file, station)).transpose()?;
        let started = self.started.map(|started| check_time(file, started)).transpose()?;
        Ok(Run {
            file: name,
            role: self.role,
            reference_azimuth_deg: check_range(
                file,
                "reference_azimuth_deg",
                self.reference_azimuth_deg,
                -360.0,
                360.0,
            )?,
            reference_sigma_deg: check_range(file, "reference_sigma_deg", self.reference_sigma_deg, 0.0, 360.0)?,
            latitude_deg: check_range(file, "latitude_deg", self.latitude_deg, -90.0, 90.0)?,
            station,
            started,
        })
    }
}

/// A number inside its range, or an error with its place. Not-a-number is outside of every range.
pub(crate) fn check_range(
    file: &TomlFile,
    name: &str,
    value: Option<Spanned<f64>>,
    low: f64,
    high: f64,
) -> Result<Option<f64>, FileError> {
    let Some(value) = value else { return Ok(None) };
    if (low..=high).contains(value.get_ref()) {
        return Ok(Some(value.into_inner()));
    }
    let problem = Problem::not_allowed(format!("{name} = {}", value.get_ref()), format!("{low} to {high}"));
    Err(file.at(value.span(), problem))
}

pub(crate) fn check_station(file: &TomlFile, value: Spanned<String>) -> Result<String, FileError> {
    if value.get_ref().trim().is_empty() {
        let problem = Problem::not_allowed(format!("station = {:?}", value.get_ref()), "the name of a place");
        return Err(file.at(value.span(), problem));
    }
    Ok(value.into_inner())
}

pub(crate) fn check_time(file: &TomlFile, value: Spanned<String>) -> Result<String, FileError> {
    if OffsetDateTime::parse(value.get_ref(), &Rfc3339).is_ok() {
        return Ok(value.into_inner());
    }
    let allowed = "an RFC 3339 time such as 2026-05-04T09:00:00Z";
    Err(file.at(value.span(), Problem::not_allowed(format!("started = {}", value.get_ref()), allowed)))
}

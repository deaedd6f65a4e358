//! Writing campaigns: runs row by row, and `campaign.toml` last, so that a folder with one is complete.

use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use north_finder::effects::channel::LEVEL_TEMPERATURE;
use north_finder::sensing::level::Specific;
use serde::Serialize;

use super::manifest::FORMAT;
use super::own::Own;
use super::{Campaign, HEADINGS, MANIFEST, Row, Run, SETTINGS, UNFINISHED};
use crate::file_error::{FileError, Problem};

/// Folder of the runs.
const RUNS: &str = "runs";
const UNFINISHED_TEXT: &str = "north is writing this recording, or was interrupted: the next one may replace it\n";

/// A run's file that is not longer has at most its line of names.
const HEAD_BYTES: u64 = 1024;

/// Removes what a recording that came to no end left behind: its runs and tables, and nothing else.
fn clear(folder: &Path) -> std::io::Result<()> {
    let runs = fs::read_dir(folder.join(RUNS)).into_iter().flatten().flatten().map(|entry| entry.path());
    let of_runs = runs.filter(|path| path.extension().is_some_and(|extension| extension == "csv"));
    let tables = [MANIFEST, SETTINGS, HEADINGS].map(|name| folder.join(name));
    of_runs.chain(tables).filter(|path| path.is_file()).try_for_each(fs::remove_file)
}

/// The file that marks a folder as being written to, locked as long as it is open, and whether a recording that came to no end had left it.
///
/// Errors: another program writes to the folder, or has just done so; the folder takes no file.
fn mark(folder: &Path) -> Result<(File, bool), Problem> {
    let path = folder.join(UNFINISHED);
    let (mut file, was_left) = match File::create_new(&path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => (File::options().write(true).open(&path)?, true),
        created => (created?, false),
    };
    lock(&file)?;
    if !path.is_file() {
        return Err(Problem::FolderNotEmpty);
    }
    if !was_left {
        file.write_all(UNFINISHED_TEXT.as_bytes())?;
    }
    Ok((file, was_left))
}

/// Locks a file until it is closed. There are file systems without locks: on these nothing is locked.
///
/// Errors: another program has locked it.
fn lock(file: &File) -> Result<(), Problem> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Problem::BeingWritten),
        Err(TryLockError::Error(error)) if error.kind() != ErrorKind::Unsupported => Err(error.into()),
        _ => Ok(()),
    }
}

/// Which optional columns a run's file has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    pub temperature: bool,
    pub level: bool,
    pub level_temperature: bool,
    pub lost_frames: bool,
    /// The instrument's own columns: of seconds, or of frames.
    pub own: Option<OwnLayout>,
    /// Names of the extra channels.
    pub extra: Vec<String>,
}

/// Which rows of the instrument's own a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnLayout {
    Seconds,
    Frames,
}

/// Writes one run.
pub struct RunWriter {
    path: PathBuf,
    layout: Layout,
    csv: csv::Writer<BufWriter<File>>,
}

impl RunWriter {
    /// Creates the file, which must not exist, and writes its header.
    pub fn create(path: &Path, layout: Layout) -> Result<Self, FileError> {
        let file = File::create_new(path).map_err(|error| FileError::whole(path, error))?;
        let mut writer = Self { path: path.to_owned(), csv: csv::Writer::from_writer(BufWriter::new(file)), layout };
        let header = writer.layout.header();
        writer.record(&header)?;
        Ok(writer)
    }

    /// Writes a row, every digit of every number. The row's interval is not written: it follows from the times.
    pub fn write(&mut self, row: &Row) -> Result<(), FileError> {
        let missing = |name: &str| FileError::whole(&self.path, Problem::MissingValue(name.into()));
        let mut fields = vec![row.t_s.to_string(), row.index_deg.to_string(), row.fog_arcsec.to_string()];
        if self.layout.temperature {
            fields.push(row.temp_c.ok_or_else(|| missing("temp_c"))?.to_string());
        }
        if self.layout.level {
            let Specific { forward, left } = row.level.ok_or_else(|| missing("ax_g"))?;
            fields.extend([forward.to_string(), left.to_string()]);
        }
        if self.layout.lost_frames {
            fields.push(row.lost_frames.to_string());
        }
        if self.layout.own.is_some() {
            fields.extend(row.own.ok_or_else(|| missing("read"))?.fields());
        }
        if self.layout.level_temperature {
            fields.push(row.level_temp_c.ok_or_else(|| missing(LEVEL_TEMPERATURE))?.to_string());
        }
        if let Some(name) = self.layout.extra.get(row.extra.len()) {
            return Err(missing(name));
        }
        fields.extend(row.extra.iter().take(self.layout.extra.len()).map(f64::to_string));
        self.record(&fields)
    }

    /// Hands what was written to the operating system.
    pub fn flush(&mut self) -> Result<(), FileError> {
        self.csv.flush().map_err(|error| FileError::whole(&self.path, error))
    }

    /// Brings everything to the disk.
    pub fn finish(mut self) -> Result<(), FileError> {
        self.flush()
    }

    fn record(&mut self, fields: &[String]) -> Result<(), FileError> {
        self.csv.write_record(fields).map_err(|error| FileError::whole(&self.path, std::io::Error::from(error)))
    }
}

impl Layout {
    fn header(&self) -> Vec<String> {
        let mut names = vec!["t_s", "index_deg", "fog_arcsec"];
        names.extend(self.temperature.then_some("temp_c"));
        names.extend(self.level.then_some(["ax_g", "ay_g"]).into_iter().flatten());
        names.extend(self.lost_frames.then_some("lost_frames"));
        names.extend(self.own.map(|own| Own::header(own == OwnLayout::Frames)).into_iter().flatten());
        names.extend(self.level_temperature.then_some(LEVEL_TEMPERATURE));
        names.extend(self.extra.iter().map(String::as_str));
        names.into_iter().map(str::to_owned).collect()
    }
}

/// Writes a campaign into a folder of its own.
pub struct CampaignWriter {
    campaign: Campaign,
    /// Names of the channels beyond those of every second.
    extra: Vec<String>,
    /// Locked: nobody else writes to the folder meanwhile.
    _mark: File,
}

/// `campaign.toml` in the order of its documentation.
#[derive(Serialize)]
struct Manifest<'a> {
    format: i64,
    #[serde(flatten)]
    campaign: &'a Campaign,
}

impl CampaignWriter {
    /// Creates the folder, or takes an existing empty one. The campaign's runs are added later.
    pub fn create(campaign: Campaign) -> Result<Self, FileError> {
        let folder = &campaign.folder;
        Self::check_free(folder)?;
        let prepare = || -> Result<File, Problem> {
            fs::create_dir_all(folder.join(RUNS))?;
            let (mark, was_left) = mark(folder)?;
            if was_left {
                clear(folder)?;
            }
            Ok(mark)
        };
        let mark = prepare().map_err(|problem| FileError::whole(folder, problem))?;
        Ok(Self { campaign, extra: Vec::new(), _mark: mark })
    }

    /// Gives a recording up that was begun in a free folder: nothing of it is left; the folder itself goes where `existed` is false.
    pub fn give_up(folder: &Path, existed: bool) {
        // What led here is the error to report.
        let _ = clear(folder);
        let _ = fs::remove_dir(folder.join(RUNS));
        let _ = fs::remove_file(folder.join(UNFINISHED));
        if !existed {
            let _ = fs::remove_dir(folder);
        }
    }

    /// Refuses a folder that has something in it, for recordings are never overwritten, or that cannot be made or written to. What a
    /// recording left behind that was interrupted is no recording; what one that goes on has written is.
    pub fn check_free(folder: &Path) -> Result<(), FileError> {
        let mark = folder.join(UNFINISHED);
        if mark.is_file() {
            let mark = File::open(mark).map_err(|error| FileError::whole(folder, error))?;
            return lock(&mark).map_err(|problem| FileError::whole(folder, problem));
        }
        match fs::read_dir(folder).map(|mut entries| entries.next().is_some()) {
            Ok(true) => Err(FileError::whole(folder, Problem::FolderNotEmpty)),
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(FileError::whole(folder, error)),
            _ => crate::output::check_folder(folder).map_err(|error| FileError::whole(folder, error)),
        }
    }

    /// The same, but rows of a recording that was interrupted are kept unless `--force` is given: a measurement cannot be made again.
    pub fn check_free_for_measurements(folder: &Path) -> Result<(), FileError> {
        Self::check_free(folder)?;
        let has_rows = |path: PathBuf| fs::metadata(path).is_ok_and(|file| file.len() > HEAD_BYTES);
        let mut runs = fs::read_dir(folder.join(RUNS)).into_iter().flatten().flatten();
        let is_kept = !crate::output::is_forced() && folder.join(UNFINISHED).is_file();
        if is_kept && runs.any(|entry| has_rows(entry.path())) {
            return Err(FileError::whole(folder, Problem::UnfinishedRows));
        }
        Ok(())
    }

    /// Names of the rows' channels beyond those of every second; empty for one that has none.
    pub fn name_extra(&mut self, names: Vec<String>) {
        self.extra = names;
    }

    pub fn extra_names(&self) -> &[String] {
        &self.extra
    }

    /// The path of a run's file.
    pub fn path_of(&self, file: &str) -> PathBuf {
        self.campaign.folder.join(file)
    }

    /// Starts the file of a run; call [`Self::add`] with the same name when it is complete.
    pub fn run(&self, file: &str, layout: Layout) -> Result<RunWriter, FileError> {
        RunWriter::create(&self.path_of(file), layout)
    }

    /// Lists a run whose file is complete.
    pub fn add(&mut self, run: Run) {
        self.campaign.runs.push(run);
    }

    /// Writes `campaign.toml`.
    pub fn finish(self) -> Result<(), FileError> {
        let path = self.campaign.folder.join(MANIFEST);
        let manifest = Manifest { format: FORMAT, campaign: &self.campaign };
        let text =
            toml::to_string(&manifest).map_err(|error| FileError::whole(&path, Problem::Syntax(error.to_string())))?;
        let folder = &self.campaign.folder;
        let write = || {
            crate::output::write(&path, &text)?;
            fs::remove_file(folder.join(UNFINISHED))
        };
        write().map_err(|error| FileError::whole(&path, error))
    }
}

//! Foreign recordings to campaigns, streamed: a mapping file says what is what.
//!
//! A record becomes a sample (units, axes, time), samples become rows, stretches of rows become runs. A triad can be
//! read as a single gyro on a virtual index, because what such a gyro would have read is cos θ · forward + sin θ · left.

mod axes;
mod block;
mod checks;
mod guess;
mod kvh;
mod map;
mod moment;
mod plausible;
mod record;
mod rows;
mod sample;
mod text;
mod unit;
mod windows;

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::block::block;
pub use self::guess::guess;
use self::map::Index;
pub use self::map::Map;
pub use self::record::Losses;

use self::checks::{check_rate, refuse_dead};
use self::kvh::KvhRecords;
use self::plausible::Means;
use self::record::Records;
use self::rows::Rows;
use self::sample::{Sample, Sampler};
use self::text::TextRecords;
use self::windows::Window;
use crate::campaign::{Campaign, CampaignWriter, Layout, Role, doubt_of_clock};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};

/// Samples between two looks at progress and interruption.
const BREATH: u64 = 1 << 14;

/// Of the file, per cent: what is less is a footer, or the end of a second that was begun.
const LEAST_REST: f64 = 0.1;

/// Said of a triad that is read as an indexed gyro.
const VIRTUAL_INDEX: &str = "a virtual index does not cancel the biases of a triad: at 180 degrees the same gyro is read with \
                             the opposite sign, and its bias with it; `north align` solves a triad whole";
/// Said of runs that are made of the same file.
const SAME_FILE: &str = "is in several runs, or twice in one: their errors are not independent";
/// Said of runs that share samples.
const OVERLAP: &str = "runs overlap: their errors are not independent";

/// How the recording is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Text, one sample a line
    #[default]
    Text,
    /// Binary log of the KVH 1750 family, format A
    Kvh,
}

/// What was imported.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    pub runs: Vec<RunSummary>,
    /// Samples that should have come in the part that was read.
    pub samples: u64,
    #[serde(flatten)]
    pub losses: Losses,
    pub declared_rate_hz: Option<f64>,
    /// Samples that should have come, by a clock that is not the gyro's; absent where none is known.
    pub measured_rate_hz: Option<f64>,
    /// What is doubtful about the recording or the mapping.
    pub doubts: Vec<String>,
    /// What one should know of runs that were made so.
    pub notes: Vec<String>,
}

/// One run that was cut from the recording.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    pub file: String,
    /// Beginning, seconds of the recording.
    pub start_s: f64,
    pub seconds: f64,
    pub rows: u64,
}

/// Turns the recording `file` into a campaign in the folder `out`, which must be free; where each position has a file of
/// its own, `file` is their folder. `breath` is told from time to time how many bytes have been read, and says whether to
/// go on.
///
/// Errors: whatever is wrong with either file, with its place; samples that do not come at the declared rate; a
/// recording shorter than its runs. After an error nothing is left in `out`.
pub fn import(
    map: &Map,
    file: &Path,
    format: Format,
    out: &Path,
    breath: &mut dyn FnMut(u64) -> bool,
) -> Result<Summary, Failure> {
    CampaignWriter::check_free(out)?;
    let existed = out.exists();
    // Opened before anything is made, so that a wrong name leaves nothing behind.
    let whole = match map.index {
        Index::Placed => None,
        Index::Measured { .. } | Index::Virtual { .. } => Some(open(map, file, format)?),
    };
    let importer = Importer::new(map, file, out, format)?;
    let imported = match whole {
        Some(sampler) => importer.one_recording(sampler, breath),
        None => importer.a_file_for_each_position(breath),
    };
    imported.inspect_err(|_| CampaignWriter::give_up(out, existed))
}

fn open<'a>(map: &'a Map, file: &Path, format: Format) -> Result<Sampler<'a>, FileError> {
    let records: Box<dyn Records> = match (format, map.time.columns.first()) {
        (Format::Text, _) => Box::new(TextRecords::open(file, map)?),
        (Format::Kvh, None) => Box::new(KvhRecords::open(file)?),
        (Format::Kvh, Some((column, _))) => {
            let problem = "the frames of this format carry no time: give their rate_hz instead of a column";
            return Err(map.file.at(column.span(), Problem::Syntax(problem.into())));
        }
    };
    Sampler::new(records, map)
}

struct Importer<'a> {
    map: &'a Map,
    file: &'a Path,
    format: Format,
    windows: windows::Windows,
    /// Runs that are being written; they may overlap.
    open: Vec<OpenRun<'a>>,
    opened: usize,
    layout: Layout,
    out: &'a Path,
    campaign: CampaignWriter,
    means: Means,
    summary: Summary,
    until_breath: u64,
    bytes_before: u64,
}

/// A run that is being written.
struct OpenRun<'a> {
    name: String,
    window: Window,
    rows: Rows<'a>,
}

impl<'a> Importer<'a> {
    fn new(map: &'a Map, file: &'a Path, out: &'a Path, format: Format) -> Result<Self, FileError> {
        let campaign = CampaignWriter::create(Campaign {
            folder: out.to_owned(),
            title: map.title.clone(),
            latitude_deg: Some(map.latitude_deg),
            instrument: map.instrument.clone(),
            runs: Vec::new(),
        })?;
        let counts_losses = format == Format::Kvh || (!map.time.columns.is_empty() && map.time.interval_s.is_some());
        let mut summary = Summary::default();
        if matches!(map.index, Index::Virtual { .. }) {
            summary.notes.push(VIRTUAL_INDEX.into());
        }
        Ok(Self {
            map,
            file,
            format,
            windows: map.windows.clone(),
            open: Vec::new(),
            opened: 0,
            layout: Rows::layout(map, counts_losses),
            out,
            campaign,
            means: Means::default(),
            summary,
            until_breath: BREATH,
            bytes_before: 0,
        })
    }

    /// Cuts the runs out of one recording.
    fn one_recording(mut self, mut sampler: Sampler, breath: &mut dyn FnMut(u64) -> bool) -> Result<Summary, Failure> {
        let mut next = self.windows.next_window();
        let mut read_whole = false;
        // The whole recording is read if its rate is to be checked against its duration.
        while next.is_some() || !self.open.is_empty() || self.map.time.duration_s.is_some() {
            let Some(sample) = sampler.next_sample()? else {
                read_whole = true;
                break;
            };
            let middle_s = sample.end_s - 0.5 * sample.interval_s;
            self.close_until(middle_s)?;
            while let Some(window) = next.take_if(|window| middle_s >= window.start_s) {
                if window.end_s.is_some_and(|end_s| middle_s >= end_s) {
                    return Err(self.without_sample(&window).into());
                }
                self.open_run(window)?;
                next = self.windows.next_window();
            }
            for run in &mut self.open {
                run.rows.push(sample)?;
            }
            if !self.open.is_empty() {
                self.means.push(sample);
            }
            self.breathe(&sampler, breath)?;
        }
        if !read_whole {
            self.note_rest(&sampler)?;
        }
        refuse_dead(&sampler, self.file)?;
        self.end_recording(sampler.end_s(), next)?;
        check_rate(self.map, self.format, &mut self.summary, &sampler, self.file)?;
        self.account(&sampler);
        self.finish()
    }

    /// Joins the files of each run's positions, without a pause between two.
    fn a_file_for_each_position(mut self, breath: &mut dyn FnMut(u64) -> bool) -> Result<Summary, Failure> {
        let mut used: Vec<(PathBuf, Role)> = Vec::new();
        while let Some(window) = self.windows.next_window() {
            let positions = window.positions.clone();
            self.note_files(&window, &mut used)?;
            self.open_run(window)?;
            let mut before_s = 0.0;
            for position in &positions {
                let path = self.file.join(&position.file);
                let mut sampler = open(self.map, &path, self.format)?;
                while let Some(sample) = sampler.next_sample()? {
                    let placed =
                        Sample { end_s: sample.end_s + before_s, index_deg: position.index_deg, ..sample.clone() };
                    for run in &mut self.open {
                        run.rows.push(&placed)?;
                    }
                    self.means.push(&placed);
                    self.breathe(&sampler, breath)?;
                }
                refuse_dead(&sampler, &path)?;
                check_rate(self.map, self.format, &mut self.summary, &sampler, &path)?;
                for run in &mut self.open {
                    run.rows.end_position()?;
                }
                before_s += sampler.end_s();
                self.account(&sampler);
                self.bytes_before += sampler.bytes_read();
            }
            self.close_until(f64::INFINITY)?;
        }
        self.finish()
    }

    /// Says what of the recording lies beyond the last run, and is not read.
    fn note_rest(&mut self, sampler: &Sampler) -> Result<(), FileError> {
        let bytes = fs::metadata(self.file).map_err(|error| FileError::whole(self.file, error))?.len();
        let share = 100.0 * bytes.saturating_sub(sampler.bytes_read()) as f64 / bytes as f64;
        if share >= LEAST_REST {
            let (file, place) = (self.file.display(), sampler.place());
            let note = format!(
                "{file}{place}: the last run ends here; what follows, {share:.1} % of the file, was not read and is in no run"
            );
            self.summary.notes.push(note);
        }
        Ok(())
    }

    /// Says which files are in several runs.
    ///
    /// Errors: a file is learned from in one run and judged by in another.
    fn note_files(&mut self, window: &Window, used: &mut Vec<(PathBuf, Role)>) -> Result<(), FileError> {
        let role = window.run.role;
        for position in &window.positions {
            let path = self.file.join(&position.file);
            let path = path.canonicalize().unwrap_or(path);
            let name = position.file.display();
            let note = format!("{name} {SAME_FILE}");
            match used.iter().find(|(other, _)| *other == path) {
                Some((_, other)) if *other != role => {
                    let problem =
                        format!("a run to learn from and a run to judge by must not hold the same file: {name}");
                    return Err(self.map.file.at(window.span.clone(), Problem::Syntax(problem)));
                }
                Some(_) if !self.summary.notes.contains(&note) => self.summary.notes.push(note),
                Some(_) => {}
                None => used.push((path, role)),
            }
        }
        Ok(())
    }

    fn breathe(&mut self, sampler: &Sampler, breath: &mut dyn FnMut(u64) -> bool) -> Result<(), Failure> {
        self.until_breath -= 1;
        if self.until_breath > 0 {
            return Ok(());
        }
        self.until_breath = BREATH;
        if breath(self.bytes_before + sampler.bytes_read()) { Ok(()) } else { Err(Failure::Interrupted) }
    }

    fn account(&mut self, sampler: &Sampler) {
        self.summary.samples += sampler.due();
        let Losses { lost_samples, invalid_samples, bad_frames, skipped_bytes } = sampler.losses();
        let losses = &mut self.summary.losses;
        losses.lost_samples += lost_samples;
        losses.invalid_samples += invalid_samples;
        losses.bad_frames += bad_frames;
        losses.skipped_bytes += skipped_bytes;
    }

    fn finish(mut self) -> Result<Summary, Failure> {
        self.summary.doubts.extend(self.means.doubts(self.map));
        let of_clock = |run: &RunSummary| doubt_of_clock(run.seconds / run.rows as f64, run.seconds);
        self.summary.doubts.extend(self.summary.runs.iter().find_map(of_clock));
        self.campaign.finish()?;
        Ok(self.summary)
    }

    fn open_run(&mut self, window: Window) -> Result<(), FileError> {
        // What is learned from a training run must not be judged on the same samples.
        if let Some(other) = self.open.iter().find(|run| run.window.run.role != window.run.role) {
            let problem = format!(
                "a run to learn from and a run to judge by must not overlap: this one begins at {} s, within {}, which \
                 begins at {} s",
                window.start_s, other.name, other.window.start_s
            );
            return Err(self.map.file.at(window.span, Problem::Syntax(problem)));
        }
        if !self.open.is_empty() && !self.summary.notes.iter().any(|note| note == OVERLAP) {
            self.summary.notes.push(OVERLAP.into());
        }
        self.opened += 1;
        let name = format!("runs/{:03}.csv", self.opened);
        let rows = Rows::new(self.map, &window, self.campaign.run(&name, self.layout.clone())?);
        self.open.push(OpenRun { name, window, rows });
        Ok(())
    }

    /// Completes the runs that end by then.
    fn close_until(&mut self, middle_s: f64) -> Result<(), FileError> {
        let ends = |run: &mut OpenRun| match run.window.end_s {
            Some(end_s) => middle_s >= end_s,
            None => middle_s == f64::INFINITY,
        };
        for run in self.open.extract_if(.., ends) {
            let (rows, seconds) = run.rows.finish()?;
            self.summary.runs.push(RunSummary { file: run.name.clone(), start_s: run.window.start_s, seconds, rows });
            self.campaign.add(crate::campaign::Run { file: run.name, ..run.window.run });
        }
        Ok(())
    }

    /// The recording has ended, perhaps within a run.
    fn end_recording(&mut self, end_s: f64, next: Option<Window>) -> Result<(), FileError> {
        // Time stamps are rounded: half a thousandth of the run is no loss.
        let short = |window: &Window| {
            window.end_s.is_some_and(|needed_s| end_s < needed_s - 0.5e-3 * (needed_s - window.start_s))
        };
        for run in self.open.extract_if(.., |run| short(&run.window)) {
            if !run.window.optional {
                return Err(too_short(self.map, self.file, &run.window, end_s));
            }
            run.rows.finish()?;
            let path = self.out.join(run.name);
            fs::remove_file(&path).map_err(|error| FileError::whole(&path, error))?;
        }
        if let Some(window) = next.filter(|window| !window.optional) {
            return Err(too_short(self.map, self.file, &window, end_s));
        }
        self.close_until(f64::INFINITY)?;
        if self.summary.runs.is_empty() {
            let problem = format!("the recording of {end_s:.3} s holds no complete run of this mapping");
            return Err(FileError::whole(self.file, Problem::Syntax(problem)));
        }
        Ok(())
    }

    fn without_sample(&self, window: &Window) -> FileError {
        let problem = format!("the recording has no sample in this run, which begins at {} s", window.start_s);
        self.map.file.at(window.span.clone(), Problem::Syntax(problem))
    }
}

fn too_short(map: &Map, file: &Path, window: &Window, end_s: f64) -> FileError {
    let needed = window.end_s.map_or_else(String::new, |needed_s| format!(" to {needed_s} s"));
    let problem =
        format!("{} ends after {end_s:.3} s; this run goes from {} s{needed}", file.display(), window.start_s);
    map.file.at(window.span.clone(), Problem::Syntax(problem))
}

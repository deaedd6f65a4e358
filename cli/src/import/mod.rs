//! Foreign recordings to campaigns, streamed: a mapping file says what is what.
//!
//! A record becomes a sample (units, axes, time), samples become rows, stretches of rows become runs. A triad can be
//! read as a single gyro on a virtual index, because what such a gyro would have read is cos θ · forward + sin θ · left.

mod axes;
mod kvh;
mod map;
mod plausible;
mod record;
mod rows;
mod sample;
mod text;
mod unit;
mod windows;

use std::fs;
use std::path::Path;

use serde::Serialize;

pub use self::map::Map;
pub use self::record::Losses;

use self::kvh::KvhRecords;
use self::plausible::Means;
use self::record::Records;
use self::rows::Rows;
use self::sample::Sampler;
use self::text::TextRecords;
use self::windows::Window;
use crate::campaign::{Campaign, CampaignWriter, Layout};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};

/// Samples come at the declared rate within this share: 0.5 %. A gyro of one family was seen at 962 Hz instead of 1000
/// with every status bit good, a scale error of 4 %.
const RATE_TOLERANCE: f64 = 0.005;
/// Samples between two looks at progress and interruption.
const BREATH: u64 = 1 << 14;

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

/// Turns the recording `file` into a campaign in the folder `out`, which must be free. `breath` is told from time to
/// time how many bytes have been read, and says whether to go on.
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
    let records: Box<dyn Records> = match (format, &map.time.column) {
        (Format::Text, _) => Box::new(TextRecords::open(file, map)?),
        (Format::Kvh, None) => Box::new(KvhRecords::open(file)?),
        (Format::Kvh, Some(column)) => {
            let problem = "the frames of this format carry no time: give their rate_hz instead of a column";
            return Err(map.file.at(column.span(), Problem::Syntax(problem.into())).into());
        }
    };
    let sampler = Sampler::new(records, map)?;
    let existed = out.exists();
    let importer = Importer::new(map, file, out, format, sampler)?;
    importer.run(breath).inspect_err(|_| {
        // The folder was free, so that everything in it is ours; the error that led here is the one to report.
        let _ = fs::remove_dir_all(out.join("runs"));
        if !existed {
            let _ = fs::remove_dir(out);
        }
    })
}

struct Importer<'a> {
    map: &'a Map,
    file: &'a Path,
    format: Format,
    sampler: Sampler<'a>,
    windows: windows::Windows,
    window: Option<Window>,
    run: Option<Rows<'a>>,
    layout: Layout,
    out: &'a Path,
    campaign: CampaignWriter,
    means: Means,
    summary: Summary,
}

impl<'a> Importer<'a> {
    fn new(
        map: &'a Map,
        file: &'a Path,
        out: &'a Path,
        format: Format,
        sampler: Sampler<'a>,
    ) -> Result<Self, FileError> {
        let campaign = CampaignWriter::create(Campaign {
            folder: out.to_owned(),
            title: map.title.clone(),
            latitude_deg: Some(map.latitude_deg),
            instrument: map.instrument.clone(),
            runs: Vec::new(),
        })?;
        let counts_losses = format == Format::Kvh || (map.time.column.is_some() && map.time.interval_s.is_some());
        let mut windows = map.windows.clone();
        Ok(Self {
            map,
            file,
            format,
            sampler,
            window: windows.next_window(),
            windows,
            run: None,
            layout: Rows::layout(map, counts_losses),
            out,
            campaign,
            means: Means::default(),
            summary: Summary::default(),
        })
    }

    fn run(mut self, breath: &mut dyn FnMut(u64) -> bool) -> Result<Summary, Failure> {
        let mut until_breath = BREATH;
        while self.next_sample()? {
            until_breath -= 1;
            if until_breath == 0 {
                until_breath = BREATH;
                if !breath(self.sampler.bytes_read()) {
                    return Err(Failure::Interrupted);
                }
            }
        }
        self.end_recording()?;
        self.check_rate()?;
        self.summary.samples = self.sampler.due();
        self.summary.losses = self.sampler.losses();
        self.summary.doubts.extend(self.means.doubts(self.map));
        self.campaign.finish()?;
        Ok(self.summary)
    }

    /// Takes one sample; `false` when no more are needed.
    fn next_sample(&mut self) -> Result<bool, FileError> {
        // The whole recording is read if its rate is to be checked against its duration.
        if self.window.is_none() && self.map.time.duration_s.is_none() {
            return Ok(false);
        }
        let Some(sample) = self.sampler.next_sample()? else { return Ok(false) };
        let middle_s = sample.end_s - 0.5 * sample.interval_s;
        while let Some(window) = self.window.take_if(|window| window.end_s.is_some_and(|end_s| middle_s >= end_s)) {
            let run = self.run.take();
            self.window = Self::next_window(&mut self.windows, self.map, &window)?;
            Self::close(&mut self.campaign, &mut self.summary, self.map, window, run)?;
        }
        let Some(window) = &self.window else { return Ok(true) };
        if middle_s >= window.start_s {
            let run = match &mut self.run {
                Some(run) => run,
                empty => {
                    let name = run_name(&self.summary);
                    empty.insert(Rows::new(self.map, window, self.campaign.run(&name, self.layout.clone())?))
                }
            };
            run.push(sample)?;
            self.means.push(sample);
        }
        Ok(true)
    }

    /// The recording has ended, perhaps within a run.
    fn end_recording(&mut self) -> Result<(), FileError> {
        let end_s = self.sampler.end_s();
        while let Some(window) = self.window.take() {
            let run = self.run.take();
            // Time stamps are rounded: half a thousandth of the run is no loss.
            let complete = window.end_s.is_none_or(|needed_s| end_s >= needed_s - 0.5e-3 * (needed_s - window.start_s));
            if !complete || run.is_none() {
                if !window.optional {
                    let needed = window.end_s.map_or_else(String::new, |needed_s| format!(" to {needed_s} s"));
                    let problem = format!(
                        "{} ends after {end_s:.3} s; this run goes from {} s{needed}",
                        self.file.display(),
                        window.start_s
                    );
                    return Err(self.map.file.at(window.span, Problem::Syntax(problem)));
                }
                if let Some(run) = run {
                    run.finish()?;
                    let path = self.out.join(run_name(&self.summary));
                    fs::remove_file(&path).map_err(|error| FileError::whole(&path, error))?;
                }
                break;
            }
            self.window = Self::next_window(&mut self.windows, self.map, &window)?;
            Self::close(&mut self.campaign, &mut self.summary, self.map, window, run)?;
        }
        if self.summary.runs.is_empty() {
            let problem = format!("the recording of {end_s:.3} s holds no complete run of this mapping");
            return Err(FileError::whole(self.file, Problem::Syntax(problem)));
        }
        Ok(())
    }

    /// The window after this one, which must not begin before this one ends.
    fn next_window(windows: &mut windows::Windows, map: &Map, this: &Window) -> Result<Option<Window>, FileError> {
        let next = windows.next_window();
        match &next {
            Some(next) if this.end_s.is_none_or(|end_s| next.start_s < end_s - 1e-9 * end_s.abs()) => {
                let end = this.end_s.map_or("the recording's end".into(), |end_s| format!("{end_s} s"));
                let problem = format!(
                    "runs must not overlap: this one begins at {} s, the one before goes from {} s to {end}",
                    next.start_s, this.start_s
                );
                Err(map.file.at(next.span.clone(), Problem::Syntax(problem)))
            }
            _ => Ok(next),
        }
    }

    /// Completes a run.
    fn close(
        campaign: &mut CampaignWriter,
        summary: &mut Summary,
        map: &Map,
        window: Window,
        run: Option<Rows<'a>>,
    ) -> Result<(), FileError> {
        let Some(run) = run else {
            let problem = format!("the recording has no sample in this run, which begins at {} s", window.start_s);
            return Err(map.file.at(window.span, Problem::Syntax(problem)));
        };
        let (rows, seconds) = run.finish()?;
        let file = run_name(summary);
        summary.runs.push(RunSummary { file: file.clone(), start_s: window.start_s, seconds, rows });
        campaign.add(crate::campaign::Run { file, ..window.run });
        Ok(())
    }

    /// Holds the samples' number against a clock that is not the gyro's: the recording's duration, or its time stamps.
    fn check_rate(&mut self) -> Result<(), Failure> {
        let time = &self.map.time;
        self.summary.declared_rate_hz = time.interval_s.map(f64::recip);
        let elapsed_s = time.duration_s.or(time.column.as_ref().map(|_| self.sampler.end_s()));
        let (Some(declared_hz), Some(elapsed_s)) = (self.summary.declared_rate_hz, elapsed_s) else {
            if elapsed_s.is_none() && self.format == Format::Kvh {
                self.summary.doubts.push(
                    "the gyro's own clock is the only one: with duration_s in [time], the recording's length by another \
                     clock, its rate is checked"
                        .into(),
                );
            }
            return Ok(());
        };
        let measured_hz = self.sampler.due() as f64 / elapsed_s;
        self.summary.measured_rate_hz = Some(measured_hz);
        if (measured_hz / declared_hz - 1.0).abs() <= RATE_TOLERANCE {
            return Ok(());
        }
        Err(Failure::Refused(format!(
            "{}: samples came at {measured_hz:.3} Hz ({} in {elapsed_s:.3} s), declared are {declared_hz:.3} Hz; allowed \
             is a difference of {} %. Gyros with a clock of their own do this with every status bit good: declare the \
             rate that was measured, or correct the duration",
            self.file.display(),
            self.sampler.due(),
            100.0 * RATE_TOLERANCE
        )))
    }
}

/// The file of the run that comes next.
fn run_name(summary: &Summary) -> String {
    format!("runs/{:03}.csv", summary.runs.len() + 1)
}

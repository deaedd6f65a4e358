//! `north record`: what a board measures, as a campaign.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use north_finder::event::{Dwell, Event, Fix, Report, State};
use north_finder::health::Fault;
use north_finder::link::{Ask, BAUD};
use north_finder::sequence::Command;

use crate::campaign::{CampaignWriter, Row, Run};
use crate::count::counted;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::{Run as RunRecord, Solved};
use crate::output::JsonOption;
use crate::port::{Port, PortError, SILENCE};
use crate::present::{Directions, View, write_fix};
use crate::recorder::{RawRecorder, Recorder, RunFile, board_campaign};

/// Name of the one run in a recording.
const RUN: &str = "runs/001.csv";
/// The columns of a recording are settled after this time at the latest, seconds; until then its rows are kept in memory.
const SETTLED_S: f64 = 10.0;

/// Record what a board measures as a campaign: every frame of the gyro, 400 a second, and every reading
///
/// `north solve`, `diagnose` and `characterise` read it. With --fix the recording gives the board's own azimuth, sigma and flags, with all their
/// digits. Ends after --seconds, with the end of the fix, or with an interrupt. Rows are on the disk as soon as their second is reported: where the line
/// breaks, what came until then is the recording.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north record /dev/ttyUSB0 --out still --seconds 3600 && north characterise still/runs/001.csv
  north record --fix --out fix && north solve fix")]
pub struct Record {
    /// The serial port; the only one on which a board answers, if it is not named
    #[arg(value_name = "PORT")]
    port: Option<String>,
    /// A new or empty folder
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Start a fix, and end with it
    #[arg(long)]
    fix: bool,
    /// End after so many seconds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Rows of one second instead of single frames
    #[arg(long)]
    means: bool,
    #[command(flatten)]
    json: JsonOption,
}

/// What is recorded.
enum Rows {
    Raw(Box<RawRecorder>),
    Means(Recorder),
}

/// What comes over the line while it is recorded.
#[derive(Default)]
struct Line {
    /// Seconds recorded.
    seconds: u32,
    /// Number of the next block of the stream.
    next_block: Option<u8>,
    lost_blocks: u32,
    bytes_before: Option<u64>,
    /// Most bytes between two seconds' reports.
    most_bytes: u64,
    dwells: Vec<Dwell>,
    fix: Option<Fix>,
    fault: Option<Fault>,
    ended: bool,
}

impl Record {
    pub fn run(self) -> Result<(), Failure> {
        CampaignWriter::check_free_for_measurements(&self.out)?;
        crate::output::check([self.json.path()])?;
        let existed = self.out.exists();
        let mut port = Port::open(self.port.as_deref())?;
        let identity = port.identity()?;
        let settings = port.settings()?.unwrap_or_default();
        let name = format!("{} {:08x}", identity.board.name(), identity.program);
        let mut campaign = board_campaign(&self.out, name, &settings)?;
        let mut rows = match self.means {
            true => Rows::Means(Recorder::default()),
            false => Rows::Raw(Box::new(RawRecorder::new(settings.gyro))),
        };
        let mut file = RunFile::new(campaign.path_of(RUN), SETTLED_S, campaign.extra_names().to_vec());
        let mut written = Ok(());
        let mut view = View::new(self.json.human(), &settings);
        let mut line = Line::default();
        let ended = self.listen(&mut port, &mut |report, bytes| {
            rows.hear(report);
            if let Event::State(State::Levelling) = report.event {
                file.start_again();
            }
            if written.is_ok() {
                written = file.push(rows.take());
            }
            line.hear(report, bytes, rows.have_begun());
            view.report(report);
            written.is_err() || self.seconds.is_some_and(|most| line.seconds >= most) || self.fix && line.ended
        });
        let mut out = view.finish()?;
        written?;
        let ended = match ended {
            // Whoever set no end ends it so.
            Err(PortError::Interrupted) if !self.fix && line.seconds > 0 => Ok(()),
            ended => ended,
        };
        let count = file.finish()?;
        if count == 0 {
            CampaignWriter::give_up(&self.out, existed);
            ended?;
            return Err(Failure::Refused(format!("{}: no whole second came: nothing is recorded", port.name())));
        }
        campaign.add(Run { file: RUN.into(), ..Run::default() });
        campaign.finish()?;
        let capacity = BAUD / 10;
        writeln!(
            out,
            "{}: {}; at most {} bytes a second of {capacity}",
            self.out.display(),
            counted(count, "row"),
            line.most_bytes
        )?;
        ended?;
        if line.lost_blocks > 0 || port.bad_frames() > 0 {
            let lost = counted(line.lost_blocks, "block");
            let damaged = counted(port.bad_frames(), "frame");
            let message = format!("lost: {lost} of the stream; damaged: {damaged}: the recording has gaps");
            return Err(Failure::Refused(message));
        }
        let dwells = &line.dwells;
        let run = match (&line.fix, line.fault) {
            (Some(fix), _) => {
                write_fix(&mut out, fix, &Directions::default(), None)?;
                RunRecord::of_fix(RUN.into(), fix, dwells)
            }
            (None, fault) => RunRecord::without_azimuth(
                RUN.into(),
                dwells,
                fault.map(Fault::name),
                Some(fault.map_or("no fix was made", Fault::meaning).into()),
            ),
        };
        self.json.write(&Solved { runs: vec![run] })?;
        match line.fault.filter(|_| self.fix && line.fix.is_none()) {
            Some(fault) => Err(Failure::Refused(format!("{}: {}", fault.name(), fault.meaning()))),
            None => Ok(()),
        }
    }

    /// Asks for the stream and the fix; hears every report with the bytes so far until `hear` says that it is enough.
    fn listen(&self, port: &mut Port, hear: &mut dyn FnMut(&Report, u64) -> bool) -> Result<(), PortError> {
        let mut early = Vec::new();
        // Whoever was here before may have left the stream on: it begins with a second of ours.
        port.ask(Ask::Stream(false), &mut |_| ())?;
        port.count_bad_frames_anew();
        if !self.means {
            port.ask(Ask::Stream(true), &mut |report| early.push(*report))?;
        }
        if self.fix {
            port.command(Command::Start, &mut |report| early.push(*report))?;
        }
        let mut enough = false;
        for report in &early {
            enough |= hear(report, port.bytes());
        }
        while !enough {
            let report = port.report(SILENCE)?;
            enough = hear(&report, port.bytes());
        }
        if !self.means && !interrupt::requested() {
            port.ask(Ask::Stream(false), &mut |_| ())?;
        }
        Ok(())
    }
}

impl Line {
    /// `begun`: there are rows; a second before the stream has no frames.
    fn hear(&mut self, report: &Report, bytes: u64, begun: bool) {
        match report.event {
            Event::Second(_) => {
                self.seconds += u32::from(begun);
                if let Some(before) = self.bytes_before.replace(bytes) {
                    self.most_bytes = self.most_bytes.max(bytes - before);
                }
            }
            Event::Raw(block) => {
                let expected = self.next_block.replace(block.number.wrapping_add(1)).unwrap_or(block.number);
                self.lost_blocks += u32::from(block.number.wrapping_sub(expected));
            }
            Event::State(State::Levelling) => (self.dwells, self.fix, self.fault) = (Vec::new(), None, None),
            Event::Dwell(dwell) => self.dwells.push(dwell),
            Event::Fix(fix) => self.fix = Some(fix),
            Event::Fault { fault, .. } => self.fault = Some(fault),
            Event::State(State::Finished | State::Failed) => self.ended = true,
            _ => {}
        }
    }
}

impl Rows {
    fn hear(&mut self, report: &Report) {
        match (self, &report.event) {
            (Self::Raw(raw), Event::Raw(block)) => block.items().for_each(|item| raw.item(&item)),
            (Self::Raw(raw), _) => raw.report(report),
            (Self::Means(means), _) => means.see(report),
        }
    }

    fn have_begun(&self) -> bool {
        match self {
            Self::Raw(raw) => raw.has_begun(),
            Self::Means(_) => true,
        }
    }

    /// The rows that have come since the last call.
    fn take(&mut self) -> Vec<Row> {
        match self {
            Self::Raw(raw) => raw.take_rows(),
            Self::Means(means) => means.take_rows(),
        }
    }
}

//! A fix as it goes: bars on a terminal, and in any case one line per change of state.

use std::fmt;
use std::io::{self, Write};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use inertial::Motion;
use north_finder::event::{Event, Heading, Report, Second, State};
use north_finder::fix::rotation::FIRST_PASS;
use north_finder::health::TestVerdict;
use north_finder::sensing::level::Tilt;
use north_finder::sequence::order::{Order, Position};
use north_finder::settings::Settings;

use super::self_test;

/// Seconds between two lines on a heading that is held.
const HELD_S: u32 = 20;

/// Shows the reports of one fix.
pub struct View {
    out: Box<dyn Write>,
    bars: Bars,
    lines: Lines,
    failed: Option<io::Error>,
}

/// What the reports of a fix are worth saying, a line each.
pub struct Lines {
    /// How long each position is to be measured.
    dwells_s: Vec<u16>,
    /// Positions that are done.
    done: u8,
    /// Whether the last line on the level said that it was.
    was_level: Option<bool>,
    /// The last heading that was held, and seconds since the last line on it.
    held: Option<Heading>,
    held_s: u32,
}

/// The moving part; draws on stderr, and nothing unless that is a terminal.
struct Bars {
    all: MultiProgress,
    position: ProgressBar,
    status: ProgressBar,
}

impl View {
    /// Lines go to `out`; `settings` tell which positions to expect.
    pub fn new(out: Box<dyn Write>, settings: &Settings) -> Self {
        Self { out, bars: Bars::new(), lines: Lines::new(settings), failed: None }
    }

    /// Shows a report. What cannot be written is kept for [`Self::finish`].
    pub fn report(&mut self, report: &Report) {
        self.bars.report(report, &self.lines.dwells_s);
        if let Some(text) = self.lines.line(report) {
            self.write(format_args!("{text}"));
        }
    }

    /// Shows lines that were made elsewhere.
    pub fn write_block(&mut self, text: &[u8]) {
        for line in String::from_utf8_lossy(text).lines() {
            self.write(format_args!("{line}"));
        }
    }

    /// Removes the bars; gives back the output for the result.
    pub fn finish(self) -> io::Result<Box<dyn Write>> {
        self.bars.clear();
        match self.failed {
            None => Ok(self.out),
            Some(error) => Err(error),
        }
    }

    fn write(&mut self, line: fmt::Arguments<'_>) {
        let out = &mut self.out;
        if let Err(error) = self.bars.all.suspend(|| writeln!(out, "{line}")) {
            self.failed.get_or_insert(error);
        }
    }
}

impl Lines {
    /// `settings` tell which positions to expect.
    pub fn new(settings: &Settings) -> Self {
        Self { dwells_s: dwells_s(settings), done: 0, was_level: None, held: None, held_s: 0 }
    }

    /// How long each position is to be measured, s.
    pub fn dwells_s(&self) -> &[u16] {
        &self.dwells_s
    }

    /// What a report is worth saying in a line, with its time.
    pub fn line(&mut self, report: &Report) -> Option<String> {
        let text = self.text(&report.event)?;
        Some(format!("{:8.1} s  {text}", report.t_s))
    }

    #[expect(clippy::too_many_lines, reason = "a line of every event")]
    fn text(&mut self, event: &Event) -> Option<String> {
        let count = self.dwells_s.len();
        let at = |position: u8| place(position, count);
        Some(match *event {
            Event::State(state @ (State::Levelling | State::Watching)) => state.name().to_owned(),
            Event::State(State::Collecting) => format!("{}: collecting", at(self.done)),
            Event::State(_) | Event::Second(_) | Event::Fix(_) | Event::Fault { .. } | Event::Health(_) => return None,
            Event::SelfTest(finding) => match finding.verdict {
                TestVerdict::Failed => format!("self-test: {}", self_test::sentence(&finding)),
                _ => return None,
            },
            Event::Crash(crash) => format!("restarted after a {}: {crash:?}", crash.cause.name()),
            // No fix has these.
            Event::Guidance(_)
            | Event::Calibration(_)
            | Event::CalibrationStored
            | Event::NoCalibration(_)
            | Event::SettingsStored
            | Event::Violation { .. }
            | Event::Answer { refusal: None, .. }
            | Event::Identity(_)
            | Event::Settings(_)
            | Event::Log { .. }
            | Event::Challenge { .. }
            | Event::Raw(_) => return None,
            Event::Answer { refusal: Some(refusal), .. } => {
                format!("refused: {}: {}. To do: {}", refusal.name(), refusal.meaning(), refusal.remedy())
            }
            Event::Vitals { program, stack_bytes, load_permille } => {
                format!(
                    "program {program:08x}, stack at most {stack_bytes} bytes, load at most {load_permille}/1000 of a tick"
                )
            }
            Event::Heading(heading) => return self.heading(heading),
            Event::Level { tilt: Tilt { pitch_deg, roll_deg }, level } => {
                if self.was_level.replace(level) == Some(level) {
                    return None;
                }
                let verdict = if level { "level" } else { "not level" };
                format!("{verdict}: pitch {pitch_deg:+.3}°, roll {roll_deg:+.3}°")
            }
            Event::Disturbed { excess_deg_h } => {
                format!("base moves: rate {excess_deg_h:.2} °/h above the Earth-rate limit; waiting")
            }
            Event::Undisturbed { excess_deg_h } => {
                let side = if excess_deg_h > 0.0 { "above" } else { "below" };
                format!("base still: rate {:.2} °/h {side} the Earth-rate limit", excess_deg_h.abs())
            }
            Event::Moving { position, target_deg } => {
                self.done = position;
                format!("{}: turning to {target_deg:.2}°", at(position))
            }
            Event::Arrived { position, index_deg } => format!("{}: at {index_deg:.3}°", at(position)),
            Event::Jitter { position, change_deg_h } => {
                format!(
                    "{}: gyro not at rest: rate changed by {change_deg_h:.2} °/h within a second; waiting",
                    at(position)
                )
            }
            Event::IndexSlipped { position, before_deg } => {
                self.done = position;
                format!("{}: index slipped from {before_deg:.3}° while the motor stood", at(position))
            }
            Event::FallenBack { dwell_s } => format!(
                "the dwells so far contradict each other, show no azimuth, or the index slipped: the mirrored four positions follow, {dwell_s} s each"
            ),
            Event::ModelAged { signal, .. } => format!(
                "the error model may no longer hold: {} moved; north log and north watch say by how much and since when",
                signal.name()
            ),
            Event::ToGo { seconds } => format!("{seconds:.0} s to go"),
            Event::Settled { position } => format!("{}: gyro at rest", at(position)),
            Event::Dwell(dwell) => {
                self.done = dwell.position.saturating_add(1);
                // Of a dwell of fewer than three seconds nothing tells it.
                let sigma =
                    if dwell.sigma_deg_h.is_finite() { format!(" ± {:.4}", dwell.sigma_deg_h) } else { String::new() };
                format!(
                    "{}: {:.0} s at {:.3}°, rate {:.4}{sigma} °/h",
                    at(dwell.position),
                    dwell.seconds,
                    dwell.index_deg,
                    dwell.rate_deg_h
                )
            }
            Event::Coarse { azimuth_deg, sigma_deg } => {
                format!(
                    "coarse azimuth {azimuth_deg:.3}° ± {sigma_deg:.3}°: now to where the axis points east and west"
                )
            }
        })
    }

    /// A line when what the instrument does changes, when a new fix is asked for, and now and then.
    fn heading(&mut self, heading: Heading) -> Option<String> {
        let Heading { heading_deg, sigma_deg, motion, refix, .. } = heading;
        let before = self.held.replace(heading);
        self.held_s += 1;
        let asked = refix && !before.is_some_and(|before| before.refix);
        if !asked && before.is_some_and(|before| before.motion == motion) && self.held_s < HELD_S {
            return None;
        }
        self.held_s = 0;
        let does = match motion {
            Motion::Standing => "standing; heading",
            Motion::Moving => "carried; heading held",
            Motion::Bridged => "samples of the block missing; heading taken on",
        };
        let asks = if asked { ": new fix asked for, sigma has passed its limit" } else { "" };
        Some(format!("{does} {heading_deg:.3}° ± {sigma_deg:.3}°{asks}"))
    }
}

impl Bars {
    fn new() -> Self {
        let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr());
        let position = all.add(ProgressBar::new(1).with_style(style("{prefix} [{bar:40}] {pos}/{len} s")));
        let status = all.add(ProgressBar::new_spinner().with_style(style("{msg}")));
        Self { all, position, status }
    }

    fn report(&self, report: &Report, dwells_s: &[u16]) {
        match report.event {
            Event::State(state) => self.status.set_message(format!("{:.1} s  {}", report.t_s, state.name())),
            Event::Second(second) => {
                if let (Some(position), true) = (second.dwell, second.collected) {
                    self.collected(position, dwells_s);
                }
                self.status.set_message(status(report.t_s, &second));
            }
            _ => {}
        }
    }

    /// A second more at this position.
    fn collected(&self, position: u8, dwells_s: &[u16]) {
        let prefix = place(position, dwells_s.len());
        if self.position.prefix() != prefix {
            self.position.set_prefix(prefix);
            self.position.set_position(0);
            self.position.set_length(dwells_s.get(usize::from(position)).copied().unwrap_or_default().into());
        }
        self.position.inc(1);
    }

    fn clear(&self) {
        self.position.finish_and_clear();
        self.status.finish_and_clear();
    }
}

fn status(t_s: f64, second: &Second) -> String {
    let index = second.index_deg.map_or("no index".to_owned(), |index_deg| format!("index {index_deg:.2}°"));
    format!("{t_s:.1} s  rate {:+.3} °/h, {index}", second.rate_deg_h)
}

/// Styles are constants of this file; a wrong one would show as the default.
fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("█▉▊▋▌▍▎▏ ")
}

/// The position of this number from 0, of `count` if that is known, or the pass of a continuous rotation.
pub fn place(position: u8, count: usize) -> String {
    match (position.checked_sub(FIRST_PASS), count) {
        (Some(pass), _) => format!("pass {}", u32::from(pass) + 1),
        (None, 0) => format!("position {}", u32::from(position) + 1),
        (None, _) => format!("position {} of {count}", u32::from(position) + 1),
    }
}

/// Measuring time at each position.
fn dwells_s(settings: &Settings) -> Vec<u16> {
    let order: &Order = &settings.sequence.order;
    (0..order.len())
        .map_while(|number| order.position(number))
        .map(|position| match position {
            Position::At { coarse: true, .. } => settings.sequence.coarse_dwell_s,
            Position::At { .. } | Position::East | Position::West => settings.sequence.dwell_s,
        })
        .collect()
}

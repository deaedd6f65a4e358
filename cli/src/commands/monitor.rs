//! `north monitor`: what a board does, as it does it.

use std::io::{self, IsTerminal, Write};

use clap::Args;
use north_finder::event::{Event, State};
use north_finder::health::TestVerdict;
use north_finder::link::Ask;
use north_finder::sequence::Command;
use north_finder::settings::Settings;

use crate::count::counted;
use crate::dashboard;
use crate::failure::Failure;
use crate::port::{Port, PortError, SILENCE};
use crate::present::{Directions, View, self_test, write_fault, write_fix};

/// Show what a board does: states, positions, gates, faults, the azimuth with its sigma
///
/// On a terminal a live view: keys s start, a abort, q quit. Elsewhere, or with --plain, lines.
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north monitor /dev/ttyUSB0 --start")]
pub struct Monitor {
    /// The serial port; the only one on which a board answers, if it is not named
    #[arg(value_name = "PORT")]
    port: Option<String>,
    /// Start a fix first
    #[arg(long)]
    start: bool,
    /// End with the first azimuth or fault
    #[arg(long)]
    once: bool,
    /// Lines instead of a live view
    #[arg(long)]
    plain: bool,
    #[command(flatten)]
    directions: Directions,
}

impl Monitor {
    pub fn run(self) -> Result<(), Failure> {
        let mut port = Port::open(self.port.as_deref())?;
        let settings = port.settings()?;
        if !self.plain && io::stdout().is_terminal() {
            return dashboard::run(&mut port, settings, self.start, self.once, &self.directions);
        }
        self.lines(&mut port, &settings.unwrap_or_default())
    }

    fn lines(&self, port: &mut Port, settings: &Settings) -> Result<(), Failure> {
        println!("{}", port.name());
        let mut early = Vec::new();
        let first = if self.start { Ask::Command(Command::Start) } else { Ask::Status };
        let started = port.ask(first, &mut |report| early.push(*report));
        let mut view = View::new(Box::new(crate::output::people()), settings);
        let mut early = early.into_iter();
        loop {
            let report = match early.next().map_or_else(|| port.report(SILENCE), Ok) {
                Ok(report) => report,
                Err(error) => {
                    let mut out = view.finish()?;
                    if port.bad_frames() > 0 {
                        let frames = counted(port.bad_frames(), "frame");
                        writeln!(out, "damaged or of another version: {frames}")?;
                    }
                    return Err(error.into());
                }
            };
            view.report(&report);
            let mut text = Vec::new();
            match report.event {
                Event::Fix(fix) => write_fix(&mut text, &fix, &self.directions, None)?,
                Event::Fault { fault, state } => write_fault(&mut text, fault, state)?,
                // Of what failed the view itself tells.
                Event::SelfTest(finding) if finding.verdict != TestVerdict::Failed => {
                    writeln!(text, "{:8.1} s  self-test: {}", report.t_s, self_test::sentence(&finding))?;
                }
                _ => {}
            }
            view.write_block(&text);
            if early.len() == 0 && started.is_err() {
                view.finish()?;
                return Ok(started?);
            }
            if self.once && matches!(report.event, Event::State(State::Finished | State::Failed)) {
                view.finish()?;
                return match report.event {
                    Event::State(State::Failed) => Err(Failure::Refused("the fix ended without an azimuth".into())),
                    _ => Ok(()),
                };
            }
        }
    }
}

impl From<PortError> for Failure {
    fn from(error: PortError) -> Self {
        match error {
            PortError::Interrupted => Self::Interrupted,
            PortError::None | PortError::Several(_) => Self::Usage(error.to_string()),
            error => Self::Refused(error.to_string()),
        }
    }
}

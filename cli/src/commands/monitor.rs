//! `north monitor`: what a board does, as it does it.

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use north_finder::event::{Event, State};
use north_finder::sequence::Command;
use north_finder::settings::Settings;

use crate::failure::Failure;
use crate::port::{Port, PortError};
use crate::present::{Directions, View, write_fault, write_fix};

/// A board reports each second.
const PATIENCE: Duration = Duration::from_secs(10);

/// Show what a board does: states, positions, gates, faults, the azimuth with its sigma
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north monitor /dev/ttyUSB0 --start")]
pub struct Monitor {
    /// The serial port; the only one that there is, if it is not named
    #[arg(value_name = "PORT")]
    port: Option<String>,
    /// Start a fix first
    #[arg(long)]
    start: bool,
    /// End with the first azimuth or fault
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    directions: Directions,
}

impl Monitor {
    pub fn run(self) -> Result<(), Failure> {
        let mut port = Port::open(self.port.as_deref())?;
        println!("{}", port.name());
        if self.start {
            port.command(Command::Start, &mut |_| ())?;
        }
        let mut view = View::new(Box::new(io::stdout()), &Settings::default());
        loop {
            let report = match port.report(PATIENCE) {
                Ok(report) => report,
                Err(error) => {
                    let mut out = view.finish()?;
                    if port.bad_frames() > 0 {
                        writeln!(out, "{} frames were damaged or of another version", port.bad_frames())?;
                    }
                    return Err(error.into());
                }
            };
            view.report(&report);
            let mut text = Vec::new();
            match report.event {
                Event::Fix(fix) => write_fix(&mut text, &fix, &self.directions, None)?,
                Event::Fault { fault, state } => write_fault(&mut text, fault, state)?,
                _ => {}
            }
            view.write_block(&text);
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

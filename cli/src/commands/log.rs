//! `north log`: what a board kept of its fixes.

use std::io::Write;
use std::path::PathBuf;

use clap::{ArgGroup, Args};
use north_finder::event::restart::Crash;
use north_finder::link::Ask;

use super::number;
use crate::count::counted;
use crate::failure::Failure;
use crate::output;
use crate::port::Port;
use crate::service::{BoardLog, write_log};

/// Read a board's log of its fixes and crashes, or mark the last fix as made at a surveyed azimuth
///
/// The board keeps the last two thousand fixes or more (a thousand with a block or analogue inputs), over power cuts and new firmware. `north watch` says whether its error model still holds.
#[derive(Args, Debug)]
#[command(group = ArgGroup::new("what").args(["out", "check", "crashes"]).required(true).multiple(true))]
#[command(after_help = "Examples:
  north log /dev/ttyUSB0 --out unit-7.csv && north watch unit-7.csv
  north log --check 123.456
  north log --crashes")]
pub struct LogCommand {
    /// The serial port; the only one on which a board answers, if it is not named
    #[arg(value_name = "PORT")]
    port: Option<String>,
    /// Write the log to this file
    #[arg(long, value_name = "LOG.csv")]
    out: Option<PathBuf>,
    /// The last fix was made at this surveyed azimuth of the index-zero mark, degrees: the board watches what it is off by
    #[arg(long, value_name = "AZIMUTH", allow_negative_numbers = true, value_parser = number::<-360, 360>)]
    check: Option<f64>,
    /// Print the crashes that the log holds
    #[arg(long)]
    crashes: bool,
}

impl LogCommand {
    pub fn run(self) -> Result<(), Failure> {
        output::check([self.out.as_deref()])?;
        let mut port = Port::open(self.port.as_deref())?;
        let mut people = output::people();
        if let Some(azimuth_deg) = self.check {
            port.ask(Ask::CheckFix { azimuth_deg }, &mut |_| ())?;
            writeln!(people, "{}: the last fix is marked as made at {azimuth_deg}°", port.name())?;
        }
        if self.out.is_none() && !self.crashes {
            return Ok(());
        }
        let mut log = BoardLog::default();
        port.log(&mut |bytes| log.take(bytes))?;
        if self.crashes {
            for (fix, crash) in &log.crashes {
                let Crash { cause, program_counter, link_register, fault_status, program, line, file, message, .. } =
                    crash;
                writeln!(
                    people,
                    "after fix {fix}: {}, program {program:08x}, at {program_counter:#010x} from {link_register:#010x}, fault status {fault_status:#010x} {}:{line} {}",
                    cause.name(),
                    file.as_str(),
                    message.as_str()
                )?;
            }
            writeln!(people, "{} crashes", log.crashes.len())?;
        }
        if let Some(path) = &self.out {
            let BoardLog { fixes, unreadable, .. } = log;
            write_log(path, &fixes)?;
            let cut = if unreadable > 0 {
                format!(", {} that a power cut left unreadable", counted(unreadable, "record"))
            } else {
                String::new()
            };
            writeln!(people, "{}: {}{cut}", path.display(), counted(fixes.len(), "fix"))?;
        }
        Ok(())
    }
}

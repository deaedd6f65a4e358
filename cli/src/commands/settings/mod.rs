//! `north settings`: what can be set, and what a board is set to.

mod board;
mod describe;

pub use board::store;

use clap::{Args, Subcommand};

use crate::failure::Failure;

/// Settings: what there is to set, and those of a board
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north settings describe
  north settings get latitude_deg gyro --port /dev/ttyUSB0
  north settings set latitude_deg=47.37 sequence.dwell_s=60
  north settings dump --out unit-7.toml
  north settings restore unit-7.toml
  north settings clock --port /dev/ttyUSB0")]
pub struct SettingsCommand {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Describe(describe::Describe),
    Get(board::Get),
    Set(board::Set),
    Dump(board::Dump),
    Restore(board::Restore),
    Clock(board::Clock),
}

impl SettingsCommand {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Describe(describe) => describe.run(),
            What::Get(get) => get.run(),
            What::Set(set) => set.run(),
            What::Dump(dump) => dump.run(),
            What::Restore(restore) => restore.run(),
            What::Clock(clock) => clock.run(),
        }
    }
}

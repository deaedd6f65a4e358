//! The verbs of the command line, one a file.

mod align;
mod bench;
pub mod board;
mod calibrate;
mod characterise;
mod completions;
mod diagnose;
pub mod doctor;
mod export;
mod find;
mod fleet;
mod import;
pub mod instrument;
mod load;
mod log;
mod man;
mod monitor;
mod record;
mod scenarios;
mod schema;
mod settings;
mod simulate;
mod solve;
mod track;
mod unlock;
mod update;
mod watch;

use clap::{Parser, Subcommand};

pub use crate::argument::{number, seed};
use crate::failure::Failure;
use crate::output::ForceOption;

/// Finds true north with an indexed single-axis gyro: simulated, recorded, measured.
///
/// Exit codes: 0 success; 1 the instrument or the data say no, with the reason; 2 usage; 130 interrupted.
#[derive(Debug, Parser)]
#[command(
    name = "north",
    version,
    max_term_width = 120,
    after_help = "Example:\n  north find --scenario calm-bench --seed 1"
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    force: ForceOption,
}

#[derive(Debug, Subcommand)]
enum Command {
    Find(find::Find),
    Align(align::Align),
    Track(track::Track),
    Solve(solve::Solve),
    Diagnose(diagnose::Diagnose),
    Simulate(simulate::Simulate),
    Import(import::Import),
    Export(export::Export),
    Calibrate(calibrate::Calibrate),
    Characterise(characterise::Characterise),
    Board(board::Board),
    Monitor(monitor::Monitor),
    Record(record::Record),
    Log(log::LogCommand),
    Watch(watch::Watch),
    Fleet(fleet::FleetCommand),
    Load(load::Load),
    Update(update::Update),
    Unlock(unlock::Unlock),
    Doctor(doctor::Doctor),
    Bench(bench::Bench),
    CloseLoop(bench::CloseLoop),
    Scenarios(scenarios::Scenarios),
    Settings(settings::SettingsCommand),
    Schema(schema::Schema),
    Completions(completions::Completions),
    Man(man::Man),
}

impl Cli {
    /// Does what was asked.
    pub fn run(self) -> Result<(), Failure> {
        self.force.apply();
        match self.command {
            Command::Find(find) => find.run(),
            Command::Align(align) => align.run(),
            Command::Track(track) => track.run(),
            Command::Solve(solve) => solve.run(),
            Command::Diagnose(diagnose) => diagnose.run(),
            Command::Simulate(simulate) => simulate.run(),
            Command::Import(import) => import.run(),
            Command::Export(export) => export.run(),
            Command::Calibrate(calibrate) => calibrate.run(),
            Command::Board(board) => board.run(),
            Command::Monitor(monitor) => monitor.run(),
            Command::Record(record) => record.run(),
            Command::Log(log) => log.run(),
            Command::Watch(watch) => watch.run(),
            Command::Fleet(fleet) => fleet.run(),
            Command::Load(load) => load.run(),
            Command::Update(update) => update.run(),
            Command::Unlock(unlock) => unlock.run(),
            Command::Doctor(doctor) => doctor.run(),
            Command::Characterise(characterise) => characterise.run(),
            Command::Bench(bench) => bench.run(),
            Command::CloseLoop(close_loop) => close_loop.run(),
            Command::Scenarios(scenarios) => scenarios.run(),
            Command::Settings(settings) => settings.run(),
            Command::Schema(schema) => schema.run(),
            Command::Completions(completions) => completions.run(),
            Command::Man(man) => man.run(),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn every_command_is_well_formed() {
        super::Cli::command().debug_assert();
    }
}

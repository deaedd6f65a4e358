//! The benches, one a file; each is a line in `benches!`.

mod accuracy;
mod adaptive;
mod ageing;
mod aiding;
mod alignment;
mod attitude;
mod blunders;
mod board_loop;
mod calibration;
mod close_loop;
mod compose;
mod composed;
mod cost;
mod diagnose;
mod diagnose_speed;
mod doctor;
mod esg;
mod experiment;
mod faults;
mod field;
pub(crate) mod fixes;
mod fleet;
mod gates;
mod grammar;
mod gyros;
mod hold;
mod image_size;
mod orders;
mod repeat;
mod validation;
mod voyage;
mod watch;

use std::io::Write;

use clap::{Args, Parser, Subcommand};
use indicatif::ProgressBar;
use north::failure::Failure;
use north::interrupt;
use north::output::{self, ForceOption, JsonOption};
use rayon::prelude::*;
use serde::Serialize;

/// A measurement: its options are fields, its rows become the table that it prints and the rows of `--json`.
pub trait Bench: Args {
    /// One line of a table. Keys are in lower case with units.
    type Row: Serialize;

    /// Measures, prints tables in Markdown and returns their rows.
    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Self::Row>, Failure>;

    /// Whether what the project promises is kept; a refusal says by name what is not.
    fn judge(&self, rows: &[Self::Row]) -> Result<(), Failure> {
        let _ = rows;
        Ok(())
    }
}

/// Measure the project itself: accuracy, calibration, diagnosis and cost
#[derive(Debug, Parser)]
#[command(
    name = "north bench",
    bin_name = "north bench",
    max_term_width = 120,
    after_help = "Example:\n  north bench accuracy --trials 4000 --json accuracy.json"
)]
pub struct Cli {
    #[command(subcommand)]
    what: What,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    force: ForceOption,
}

/// Lists the benches: a variant, which gives the name on the command line, and the type with its options.
macro_rules! benches {
    ($($Name:ident: $Bench:ty),* $(,)?) => {
        #[derive(Debug, Subcommand)]
        enum What {
            $($Name($Bench)),*
        }

        impl Cli {
            /// Does what was asked.
            pub fn run(self) -> Result<(), Failure> {
                self.force.apply();
                match self.what {
                    $(What::$Name(bench) => run(&bench, &self.json)),*
                }
            }
        }
    };
}

benches! {
    Accuracy: accuracy::Accuracy,
    Adaptive: adaptive::Adaptive,
    Ageing: ageing::AgeingBench,
    Aiding: aiding::Aiding,
    Alignment: alignment::AlignmentBench,
    Attitude: attitude::AttitudeBench,
    Blunders: blunders::BlundersBench,
    BoardLoop: board_loop::BoardLoop,
    Calibration: calibration::Calibration,
    CloseLoop: close_loop::CloseLoop,
    Compose: compose::Compose,
    Cost: cost::CostBench,
    Diagnose: diagnose::DiagnoseBench,
    DiagnoseSpeed: diagnose_speed::DiagnoseSpeed,
    Doctor: doctor::DoctorBench,
    Esg: esg::EsgBench,
    Experiment: experiment::ExperimentBench,
    Faults: faults::Faults,
    Field: field::FieldBench,
    Fleet: fleet::FleetBench,
    Gates: gates::Gates,
    Grammar: grammar::GrammarBench,
    Gyros: gyros::Gyros,
    Orders: orders::Orders,
    Repeat: repeat::Repeat,
    Validation: validation::ValidationBench,
    Hold: hold::HoldBench,
    Voyage: voyage::VoyageBench,
    Watch: watch::WatchBench,
}

/// The machine-readable result of every bench.
#[derive(Serialize)]
struct Report<'a, R> {
    rows: &'a [R],
}

fn run<B: Bench>(bench: &B, json: &JsonOption) -> Result<(), Failure> {
    output::check([json.path()])?;
    let rows = bench.measure(&mut json.human())?;
    json.write(&Report { rows: &rows })?;
    bench.judge(&rows)
}

/// Runs numbered trials on all cores, in a fixed order; an interrupt ends them.
fn trials<T: Send>(
    numbers: impl IntoParallelIterator<Item = u64>,
    bar: &ProgressBar,
    run: impl Fn(u64) -> T + Sync,
) -> Result<Vec<T>, Failure> {
    let trials = numbers
        .into_par_iter()
        .take_any_while(|_| !interrupt::requested())
        .map(|number| {
            let trial = run(number);
            bar.inc(1);
            trial
        })
        .collect();
    if interrupt::requested() { Err(Failure::Interrupted) } else { Ok(trials) }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn every_bench_is_well_formed_and_has_an_example() {
        let mut command = super::Cli::command();
        command.clone().debug_assert();
        for bench in command.get_subcommands_mut().filter(|bench| bench.get_name() != "help") {
            let help = bench.render_long_help().to_string();
            assert!(help.contains("Example") && help.contains("  north bench "), "{help}");
        }
    }
}

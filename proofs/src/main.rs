//! The program behind `north bench`.

use std::process::ExitCode;

use clap::Parser;
use north::interrupt;
use proofs::bench::Cli;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Err(error) = interrupt::watch() {
        eprintln!("north: interrupts cannot be caught: {error}");
    }
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.is_silent() {
                eprintln!("north: {failure}");
            }
            failure.exit_code()
        }
    }
}

//! The command `north`.

use std::process::ExitCode;

use clap::Parser;
use north::commands::Cli;
use north::{interrupt, output};

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Err(error) = interrupt::watch() {
        eprintln!("north: interrupts cannot be caught: {error}");
    }
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.is_silent() {
                eprintln!("{}", output::message(&format!("north: {failure}")));
            }
            failure.exit_code()
        }
    }
}

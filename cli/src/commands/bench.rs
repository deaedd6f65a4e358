//! `north bench`: hands over to the proofs, which are not shipped.

use std::env;
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use std::path::Path;
use std::process::Command;

use clap::Args;

use crate::failure::Failure;

/// The proofs beside the sources that this program was built from.
const MANIFEST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../proofs/Cargo.toml");

/// Measure the project itself, in a checkout of its sources: accuracy, calibration, diagnosis, cost
///
/// The benches are not part of this program: cargo builds and runs them in the checkout that it was built from.
/// "north bench help" lists them.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench help\n  north bench accuracy --trials 4000 --json accuracy.json")]
pub struct Bench {
    /// A bench and its options
    #[arg(value_name = "BENCH", trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Close the loop with the firmware itself: the same as "north bench close-loop"
#[derive(Args, Debug)]
#[command(disable_help_flag = true)]
pub struct CloseLoop {
    #[arg(value_name = "OPTIONS", trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

impl CloseLoop {
    pub fn run(self) -> Result<(), Failure> {
        let bench = Bench { arguments: ["close-loop".into()].into_iter().chain(self.arguments).collect() };
        bench.run()
    }
}

impl Bench {
    pub fn run(self) -> Result<(), Failure> {
        if !Path::new(MANIFEST).exists() {
            return Err(Failure::Refused(format!(
                "the benches are run in a checkout of the sources, and there is none at {MANIFEST}"
            )));
        }
        // The benches are built as this program is; else a test would wait for the other build.
        let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
        let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        command.args(["run", "--profile", profile, "--manifest-path", MANIFEST]);
        if !io::stderr().is_terminal() {
            command.arg("--quiet");
        }
        command.arg("--").args(self.arguments);
        replace(command)
    }
}

/// Becomes the other program: output, exit code and signals are its own.
#[cfg(unix)]
fn replace(mut command: Command) -> Result<(), Failure> {
    use std::os::unix::process::CommandExt;
    Err(Failure::Refused(format!("cargo cannot be started: {}", command.exec())))
}

#[cfg(not(unix))]
fn replace(mut command: Command) -> Result<(), Failure> {
    let status = command.status().map_err(|error| Failure::Refused(format!("cargo cannot be started: {error}")))?;
    std::process::exit(status.code().unwrap_or(1))
}

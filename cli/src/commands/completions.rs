//! `north completions`: completion scripts for shells.

use std::io;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::Cli;
use crate::failure::Failure;

/// Print the completion script of a shell
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north completions bash > ~/.local/share/bash-completion/completions/north")]
pub struct Completions {
    shell: Shell,
}

impl Completions {
    pub fn run(self) -> Result<(), Failure> {
        // Into memory first: the generator panics when a pipe closes.
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "north", &mut script);
        Ok(io::Write::write_all(&mut io::stdout(), &script)?)
    }
}

//! `north man`: the manual page.

use std::io::{self, Write};

use clap::{Args, Command, CommandFactory};
use clap_mangen::Man as Page;

use super::Cli;
use crate::failure::Failure;

/// Print the manual page, with a section for every command
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north man > north.1 && man ./north.1")]
pub struct Man {}

impl Man {
    pub fn run(self) -> Result<(), Failure> {
        let mut command = Cli::command();
        command.build();
        let mut page = Vec::new();
        Page::new(command.clone()).render(&mut page)?;
        for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
            render_verb(verb, &mut page)?;
        }
        Ok(io::stdout().write_all(&page)?)
    }
}

/// A verb's own page without its title line, as sections of the one page.
fn render_verb(verb: &Command, page: &mut Vec<u8>) -> io::Result<()> {
    let own = Page::new(verb.clone());
    writeln!(page, ".SH \"NORTH {}\"", verb.get_name().to_uppercase())?;
    own.render_synopsis_section(page)?;
    own.render_description_section(page)?;
    own.render_options_section(page)?;
    own.render_extra_section(page)
}

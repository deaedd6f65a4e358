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
        let whole = Page::new(command.clone());
        whole.render_title(&mut page)?;
        whole.render_name_section(&mut page)?;
        whole.render_synopsis_section(&mut page)?;
        whole.render_description_section(&mut page)?;
        whole.render_options_section(&mut page)?;
        whole.render_extra_section(&mut page)?;
        for verb in verbs(&command) {
            let below: Vec<_> = verbs(verb).collect();
            if below.is_empty() {
                render_verb(verb, &mut page)?;
            }
            below.into_iter().try_for_each(|verb| render_verb(verb, &mut page))?;
        }
        Ok(io::stdout().write_all(&page)?)
    }
}

fn verbs(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|verb| verb.get_name() != "help")
}

/// A verb's own page without its title line, as sections of the one page.
fn render_verb(verb: &Command, page: &mut Vec<u8>) -> io::Result<()> {
    let own = Page::new(verb.clone());
    let name = verb.get_bin_name().unwrap_or(verb.get_name());
    writeln!(page, ".SH \"{}\"", name.to_uppercase())?;
    own.render_synopsis_section(page)?;
    own.render_description_section(page)?;
    own.render_options_section(page)?;
    own.render_extra_section(page)
}

//! `north scenarios`: which simulated worlds there are.

use std::io::{self, Write};

use clap::Args;
use hal_sim::Scenario;

use crate::failure::Failure;

/// List the built-in scenarios
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north scenarios")]
pub struct Scenarios {}

impl Scenarios {
    pub fn run(self) -> Result<(), Failure> {
        Ok(list(&mut crate::output::people())?)
    }
}

/// Name and description of every built-in scenario, one a line.
pub fn list(out: &mut dyn Write) -> io::Result<()> {
    let width = Scenario::names().map(|(name, _)| name.len()).max().unwrap_or_default();
    Scenario::names().try_for_each(|(name, description)| writeln!(out, "{name:<width$}  {description}"))
}

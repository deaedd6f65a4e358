//! `north scenarios`: which simulated worlds there are, and what a file of one's own may hold.

use std::io::{self, Write};

use clap::Args;
use hal_sim::{Group, Scenario};

use crate::failure::Failure;
use crate::output::JsonOption;

/// List the built-in scenarios, or what a scenario file may hold
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north scenarios
  north scenarios --describe")]
pub struct Scenarios {
    /// Everything that a scenario file may hold: meaning, default, what is allowed
    #[arg(long)]
    describe: bool,
    #[command(flatten)]
    json: JsonOption,
}

impl Scenarios {
    pub fn run(self) -> Result<(), Failure> {
        let out = &mut self.json.human();
        if self.describe {
            let groups = Scenario::describe();
            describe(out, &groups)?;
            return self.json.write(&groups);
        }
        list(out)?;
        let all: Vec<_> = Scenario::names()
            .map(|(name, description)| serde_json::json!({ "name": name, "description": description }))
            .collect();
        self.json.write(&all)
    }
}

/// Name and description of every built-in scenario, one a line.
fn list(out: &mut dyn Write) -> io::Result<()> {
    let width = Scenario::names().map(|(name, _)| name.len()).max().unwrap_or_default();
    Scenario::names().try_for_each(|(name, description)| writeln!(out, "{name:<width$}  {description}"))
}

/// The groups as tables of Markdown.
fn describe(out: &mut dyn Write, groups: &[Group]) -> io::Result<()> {
    for group in groups {
        let heading =
            if group.table.name.is_empty() { "The file itself".to_owned() } else { format!("`{}`", group.table) };
        writeln!(out, "### {heading}\n\n{}\n", group.meaning)?;
        if group.fields.is_empty() {
            continue;
        }
        writeln!(out, "| key | default | allowed | meaning |\n|---|---|---|---|")?;
        for field in &group.fields {
            let default = if field.default.is_empty() { "absent".to_owned() } else { format!("`{}`", field.default) };
            writeln!(out, "| `{}` | {default} | {} | {} |", field.name, field.allowed, field.meaning)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

//! `north schema`: the JSON schemas of what commands write.

use std::io::Write;

use clap::{Args, ValueEnum};
use schemars::schema_for;

use super::doctor::Finding;
use super::track::Summary;
use crate::diagnose::Diagnosis;
use crate::failure::Failure;
use crate::json::{Found, Solved};
use crate::output::people;
use crate::report::align::Report;

/// Print the JSON schema of what a command writes with --json
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north schema solve > solve.schema.json")]
pub struct Schema {
    #[arg(value_enum)]
    command: Written,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Written {
    Find,
    /// Also of `record`
    Solve,
    Doctor,
    Diagnose,
    Align,
    Track,
}

impl Schema {
    pub fn run(self) -> Result<(), Failure> {
        let schema = match self.command {
            Written::Find => schema_for!(Found),
            Written::Solve => schema_for!(Solved),
            Written::Doctor => schema_for!(Vec<Finding>),
            Written::Diagnose => schema_for!(Diagnosis),
            Written::Align => schema_for!(Report),
            Written::Track => schema_for!(Summary),
        };
        let text = serde_json::to_string_pretty(&schema).map_err(|error| Failure::Refused(error.to_string()))?;
        Ok(writeln!(people(), "{text}")?)
    }
}

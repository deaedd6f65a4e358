//! `north settings describe`: what can be set.

use std::io::Write;

use clap::Args;
use north_finder::settings::Settings;
use north_finder::settings::fields::{FIELDS, WORDS};
use serde::Serialize;

use crate::failure::Failure;
use crate::output::JsonOption;

/// Every number that can be set: meaning, unit, limits, default
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings describe --json -")]
pub struct Describe {
    #[command(flatten)]
    json: JsonOption,
}

/// A number that can be set.
#[derive(Serialize)]
pub struct Described {
    name: &'static str,
    unit: &'static str,
    low: f64,
    high: f64,
    default: f64,
    meaning: &'static str,
}

impl Describe {
    pub fn run(self) -> Result<(), Failure> {
        let json = self.json;
        let defaults = Settings::default();
        let rows = FIELDS.iter().zip(WORDS).map(|(field, words)| Described {
            name: field.name,
            unit: words.unit,
            low: field.low,
            high: field.high,
            default: (field.value)(&defaults),
            meaning: words.meaning,
        });
        let rows: Vec<_> = rows.collect();
        let out = &mut json.human();
        for (row, field) in rows.iter().zip(FIELDS) {
            writeln!(out, "{} = {} {}, allowed {}", row.name, row.default, row.unit, field.allowed)?;
            writeln!(out, "    {}", row.meaning)?;
        }
        json.write(&rows)
    }
}

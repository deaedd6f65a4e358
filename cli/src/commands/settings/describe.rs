//! `north settings describe`: what can be set.

use std::io::Write;

use clap::Args;
use north_finder::settings::Settings;
use north_finder::settings::fields::{CHOICES, FIELDS, WORDS};
use serde::Serialize;

use crate::failure::Failure;
use crate::output::JsonOption;

/// Everything that can be set by a number or a word: meaning, unit, limits, default
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings describe --json -")]
pub struct Describe {
    #[command(flatten)]
    json: JsonOption,
}

/// Something that can be set.
#[derive(Serialize)]
#[serde(untagged)]
enum Described {
    Number {
        name: &'static str,
        unit: &'static str,
        low: f64,
        high: f64,
        /// None: see the meaning.
        default: Option<f64>,
        meaning: &'static str,
    },
    Word {
        name: &'static str,
        allowed: &'static [&'static str],
        default: &'static str,
        meaning: &'static str,
    },
}

impl Describe {
    pub fn run(self) -> Result<(), Failure> {
        let json = self.json;
        let defaults = Settings::default();
        let mut rows = Vec::new();
        let out = &mut json.human();
        for (field, words) in FIELDS.iter().zip(WORDS) {
            let default = (field.value)(&defaults);
            let said = default.map_or_else(|| "not said".to_owned(), |value| format!("{value} {}", words.unit));
            writeln!(out, "{} = {said}, allowed {}", field.name, field.allowed)?;
            writeln!(out, "    {}", words.meaning)?;
            rows.push(Described::Number {
                name: field.name,
                unit: words.unit,
                low: field.low,
                high: field.high,
                default,
                meaning: words.meaning,
            });
        }
        for choice in CHOICES {
            let default = choice.allowed.first().copied().unwrap_or_default();
            writeln!(out, "{} = {default}, allowed {}", choice.name, choice.allowed.join(", "))?;
            writeln!(out, "    {}", choice.meaning)?;
            let (name, allowed, meaning) = (choice.name, choice.allowed, choice.meaning);
            rows.push(Described::Word { name, allowed, default, meaning });
        }
        json.write(&rows)
    }
}

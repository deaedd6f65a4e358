//! Reports of the instrument as the page's script reads them.

use north_finder::event::{Event, Report};
use serde::Serialize;
use serde_json::Value;

/// A report.
#[derive(Debug, Serialize)]
pub struct Reported {
    pub t_s: f64,
    /// Name of the event, as in docs/formats.md.
    pub name: &'static str,
    /// The event with its fields, as it is declared.
    pub event: Value,
    /// Flags of a fix, or the fault that ended it.
    pub words: Vec<Word>,
}

/// A flag or a fault: its name, what it means, what to do about it.
#[derive(Debug, Serialize)]
pub struct Word {
    pub name: &'static str,
    pub meaning: &'static str,
    pub remedy: &'static str,
}

impl Reported {
    pub fn new(report: &Report) -> Self {
        let words = match report.event {
            Event::Fix(fix) => fix
                .flags
                .iter()
                .map(|flag| Word { name: flag.name(), meaning: flag.meaning(), remedy: flag.remedy() })
                .collect(),
            Event::Fault { fault, .. } => {
                vec![Word { name: fault.name(), meaning: fault.meaning(), remedy: fault.remedy() }]
            }
            _ => Vec::new(),
        };
        // All events are plain data, of which JSON can be made.
        let event = serde_json::to_value(report.event).unwrap_or_default();
        Self { t_s: report.t_s, name: report.event.name(), event, words }
    }
}

//! What can be wrong with a scenario, said so that it can be found and put right.

use super::check::Violation;
use std::fmt;
use toml::de::{DeTable, DeValue};

/// A scenario that cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub enum ScenarioError {
    /// No built-in scenario has this name.
    UnknownName {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<&'static str>,
    },
    /// The file cannot be read.
    Unreadable {
        /// The file.
        file: String,
        /// Why, in the system's words.
        reason: String,
    },
    /// Not TOML, a field that does not exist, or a value of the wrong type.
    Syntax {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The text that is wrong: field and value as written.
        found: String,
        /// What is wrong and what is expected.
        message: String,
    },
    /// A number outside its range.
    Value {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The field, dotted from the root.
        field: String,
        /// The value as read.
        value: String,
        /// What is allowed.
        allowed: String,
    },
}

impl ScenarioError {
    pub(super) fn syntax(file: &str, text: &str, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start).min(text.len());
        let (line, column) = position(text, start);
        let found = text.lines().nth(line - 1).unwrap_or_default().trim().to_owned();
        Self::Syntax { file: file.to_owned(), line, column, found, message: error.message().replace('\n', "; ") }
    }

    pub(super) fn value(file: &str, text: &str, violation: &Violation) -> Self {
        let (line, _) = position(text, offset_of(text, &violation.path));
        Self::Value {
            file: file.to_owned(),
            line,
            field: violation.field(),
            value: violation.value.clone(),
            allowed: violation.allowed.clone(),
        }
    }
}

/// Line and column (from 1) of a byte offset.
fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// Byte offset of the value at `path`, or of its nearest ancestor that the text contains.
fn offset_of(text: &str, path: &[String]) -> usize {
    let Ok(root) = DeTable::parse(text) else { return 0 };
    let mut offset = 0;
    let mut value = DeValue::Table(root.into_inner());
    for step in path {
        let next = match value {
            DeValue::Table(table) => {
                table.into_iter().find(|(key, _)| key.get_ref().as_ref() == step).map(|(_, value)| value)
            }
            DeValue::Array(items) => step.parse::<usize>().ok().and_then(|position| items.into_iter().nth(position)),
            _ => None,
        };
        let Some(next) = next else { return offset };
        offset = next.span().start;
        value = next.into_inner();
    }
    offset
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownName { name, known } => {
                write!(f, "there is no scenario \"{name}\"; the built-in ones are: {}", known.join(", "))
            }
            Self::Unreadable { file, reason } => write!(f, "{file}: cannot be read: {reason}"),
            Self::Syntax { file, line, column, found, message } => {
                write!(f, "{file}:{line}:{column}: `{found}`: {message}")
            }
            Self::Value { file, line, field, value, allowed } => {
                write!(f, "{file}:{line}: {field} = {value} is out of range; allowed: {allowed}")
            }
        }
    }
}

impl std::error::Error for ScenarioError {}

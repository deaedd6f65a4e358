//! One kind of error for everything that is read from or written to a file: which file, where in it, what is wrong.

use std::fmt;
use std::path::{Path, PathBuf};

/// Characters of a wrong value that are repeated in an error.
const LONGEST_VALUE: usize = 80;

/// Something wrong with a file, with its place as far as it is known.
#[derive(Debug, thiserror::Error)]
#[error("{}{place}: {problem}", file.display())]
pub struct FileError {
    pub file: PathBuf,
    pub place: Place,
    pub problem: Problem,
}

/// A place in a text file. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    Whole,
    Line(u64),
    /// A character in a line.
    Character {
        line: u64,
        column: u64,
    },
    /// A field of a table with separated columns.
    Field {
        line: u64,
        column: usize,
        name: String,
    },
}

/// What is wrong.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Syntax(String),
    #[error("{} values are not allowed{}", .0.len(), .0.iter().map(|each| format!("\n  {}", each.within())).collect::<String>())]
    Several(Vec<FileError>),
    #[error("the file is empty; a header row is needed")]
    Empty,
    #[error("no data rows follow the header")]
    NoRows,
    #[error("column `{name}` is missing; the header has: {found}{}", of_separator(.found))]
    MissingColumn { name: &'static str, found: String },
    #[error("column name {name:?} appears twice; the first is column {first}")]
    DuplicateColumn { name: String, first: usize },
    #[error("a column has no name")]
    UnnamedColumn,
    #[error("{found} fields; the header has {expected}")]
    Ragged { found: usize, expected: usize },
    #[error("{value:?} is not allowed; allowed is {allowed}")]
    NotAllowed { value: String, allowed: String },
    #[error("time {t_s} is not later than the previous row's {previous_s}; `t_s` must increase from row to row")]
    TimeNotIncreasing { t_s: f64, previous_s: f64 },
    #[error("a single row at t_s = 0 has no interval; give its end, or a second row")]
    NoInterval,
    #[error("the same recording as {0}: it would count twice")]
    CopyOf(String),
    #[error("this row lacks a value for column `{0}`")]
    MissingValue(String),
    #[error("the folder is not empty; recordings are never overwritten: name a new folder or empty this one")]
    FolderNotEmpty,
    #[error(
        "the recording in this folder came to no end; rows that were written are in runs/, each file a run of its own"
    )]
    Unfinished,
    #[error(
        "there are rows of a recording that came to no end in runs/: name another folder, or replace them with --force"
    )]
    UnfinishedRows,
    #[error("another north is writing a recording into this folder: name another folder, or wait until it has ended")]
    BeingWritten,
    #[error("no campaign: a campaign is a folder, or its campaign.toml")]
    NoCampaign,
}

impl FileError {
    pub fn new(file: &Path, place: Place, problem: impl Into<Problem>) -> Self {
        Self { file: file.to_owned(), place, problem: problem.into() }
    }

    /// Place and problem, where the file has been named.
    fn within(&self) -> String {
        let place = self.place.to_string();
        let place = place.strip_prefix(", ").unwrap_or(&place);
        if place.is_empty() { self.problem.to_string() } else { format!("{place}: {}", self.problem) }
    }

    /// An error of the file as a whole: it cannot be opened, created or written.
    pub fn whole(file: &Path, problem: impl Into<Problem>) -> Self {
        Self::new(file, Place::Whole, problem)
    }
}

impl Problem {
    /// A value outside of what is allowed; of one that is longer than anyone wants to read, the beginning.
    pub fn not_allowed(value: impl fmt::Display, allowed: impl Into<String>) -> Self {
        let mut value = value.to_string();
        if let Some((end, _)) = value.char_indices().nth(LONGEST_VALUE) {
            let length = value.chars().count();
            value.truncate(end);
            value += &format!("… ({length} characters)");
        }
        Self::NotAllowed { value, allowed: allowed.into() }
    }
}

/// What to do where the one name in a header is several that something else than a comma separates.
fn of_separator(header: &str) -> &'static str {
    match header.contains([';', '\t']) && !header.contains(',') {
        true => "; columns are separated by commas here: `north import` reads others",
        false => "",
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Character { line, column } => write!(f, ", line {line}, column {column}"),
            Self::Field { line, column, name } => write!(f, ", line {line}, column {column} ({name})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_no_comma_separates_are_told() {
        let said = |found: &str| Problem::MissingColumn { name: "t_s", found: found.into() }.to_string();
        assert!(
            said("t_s;gx_arcsec")
                .ends_with("t_s;gx_arcsec; columns are separated by commas here: `north import` reads others")
        );
        assert!(said("t_s\tgx_arcsec").contains("`north import`"));
        assert!(said("time, gx_arcsec").ends_with("time, gx_arcsec") && said("a;b, c").ends_with("a;b, c"));
    }

    #[test]
    fn a_huge_cell_is_not_echoed_and_control_characters_are_escaped() {
        let value = format!("\x1b[31m{}", "7".repeat(5_000_000));
        let text = Problem::not_allowed(value, "a number").to_string();
        assert_eq!(
            text,
            format!("\"\\u{{1b}}[31m{}… (5000005 characters)\" is not allowed; allowed is a number", "7".repeat(75))
        );
    }
}

//! Proposes a mapping for a recording that nobody has described: delimiter, header, footer, columns, units by the size of gravity and of the Earth's
//! rate, interval, axes, runs. It is a file to edit, with the reason for each guess beside it; what nothing tells is left so that an import refuses it.

mod columns;
mod proposal;
mod table;
mod units;

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use self::table::Table;
use super::text::refuse_binary;
use crate::file_error::{FileError, Problem};

/// So much of the file's beginning is looked at, and of its end.
const HEAD: u64 = 4 << 20;
const TAIL: u64 = 1 << 16;

/// The columns that every run has, and no other recording.
const OF_RUN: [&str; 3] = ["t_s", "index_deg", "fog_arcsec"];
const NO_ROWS: &str = "no rows of numbers with the same number of columns were found: this is not a text recording";
const JSON: &str =
    "this is a JSON file, not a table: write its samples as text, one a line with a delimiter between the columns";
/// Said of a file that has the columns of a run.
const RUN: &str = "this is a run (docs/formats.md), as north itself records and reads them: it needs no import. `north solve` and \
                   `north diagnose` read it in a campaign, and `north solve FILE --latitude DEG` reads it alone";

/// The text of a mapping for the recording.
///
/// Errors: no such file, an empty or a binary file, no rows of numbers; a run, which needs no mapping.
pub fn guess(path: &Path, latitude_deg: Option<f64>) -> Result<String, FileError> {
    let io = |error| FileError::whole(path, Problem::Io(error));
    let mut file = crate::input::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    let mut part = |begin: u64, length: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(begin))?;
        file.by_ref().take(length).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let head = part(0, HEAD).map_err(io)?;
    let tail = part(bytes.saturating_sub(TAIL), TAIL).map_err(io)?;
    refuse_binary(path, &head)?;
    let (head, tail) = (String::from_utf8_lossy(&head), String::from_utf8_lossy(&tail));
    // A byte-order mark is no part of a name.
    let head = head.strip_prefix('\u{feff}').unwrap_or(&head);
    let refuse = |problem: &str| Err(FileError::whole(path, Problem::Syntax(problem.into())));
    match Table::read(head, &tail, Some(bytes).filter(|bytes| *bytes > HEAD)) {
        Some(table) if is_run(&table) => refuse(RUN),
        Some(table) => Ok(proposal::of(&table, path, latitude_deg)),
        None if is_json(head) => refuse(JSON),
        None => refuse(NO_ROWS),
    }
}

/// Whether it begins as an object or a list does; a heading in brackets is none.
fn is_json(head: &str) -> bool {
    let text = head.trim_start();
    text.strip_prefix(['{', '['])
        .is_some_and(|inner| inner.trim_start().starts_with(|c: char| "\"{[-".contains(c) || c.is_ascii_digit()))
}

/// Whether the columns that every run has are there.
fn is_run(table: &Table) -> bool {
    OF_RUN.iter().all(|name| table.names.iter().any(|found| found == name))
}

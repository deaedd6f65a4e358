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

/// The text of a mapping for the recording.
///
/// Errors: no such file, a binary file, no rows of numbers.
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
    let table = Table::read(&head, &tail, bytes).ok_or_else(|| {
        let problem = "no rows of numbers with the same number of columns were found: this is not a text recording";
        FileError::whole(path, Problem::Syntax(problem.into()))
    })?;
    Ok(proposal::of(&table, path, latitude_deg))
}

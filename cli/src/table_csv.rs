//! CSV files with a header row and numbers: row by row, every error with file, line, column and value.

use std::fs::File;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Reader, ReaderBuilder, Trim};

use crate::file_error::{FileError, Place, Problem};
use crate::input;

/// A table that is being read.
pub struct TableCsv {
    path: PathBuf,
    header: Vec<String>,
    reader: Reader<input::Records<File>>,
    record: ByteRecord,
}

impl TableCsv {
    /// Reads the header. Errors: no such file, an empty one.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let whole = |error: csv::Error| FileError::whole(path, std::io::Error::from(error));
        let records = input::records(path).map_err(|error| FileError::whole(path, error))?;
        let mut reader = ReaderBuilder::new().flexible(true).trim(Trim::All).from_reader(records);
        let header: Vec<String> = reader.headers().map_err(whole)?.iter().map(str::to_owned).collect();
        if header.iter().all(String::is_empty) {
            return Err(FileError::whole(path, Problem::Empty));
        }
        Ok(Self { path: path.to_owned(), header, reader, record: ByteRecord::new() })
    }

    /// Names of the columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Place of a column that may be there.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column == name)
    }

    /// Place of a column that may be there, once.
    pub fn find_one(&self, name: &str) -> Result<Option<usize>, FileError> {
        let Some(first) = self.find(name) else { return Ok(None) };
        match self.header.iter().skip(first + 1).position(|column| column == name) {
            Some(further) => {
                let place = Place::Field { line: 1, column: first + further + 2, name: name.into() };
                Err(FileError::new(&self.path, place, Problem::DuplicateColumn { name: name.into(), first: first + 1 }))
            }
            None => Ok(Some(first)),
        }
    }

    /// Place of a column that has to be there, once.
    pub fn column(&self, name: &'static str) -> Result<usize, FileError> {
        self.find_one(name)?.ok_or_else(|| {
            let found = self.header.join(", ");
            FileError::new(&self.path, Place::Line(1), Problem::MissingColumn { name, found })
        })
    }

    /// The next row, if there is one.
    pub fn next_row(&mut self) -> Result<bool, FileError> {
        let read = self.reader.read_byte_record(&mut self.record);
        let more = read.map_err(|error| FileError::whole(&self.path, std::io::Error::from(error)))?;
        self.reader.get_mut().record();
        if more && self.record.len() != self.header.len() {
            let problem = Problem::Ragged { found: self.record.len(), expected: self.header.len() };
            return Err(FileError::new(&self.path, Place::Line(self.line()), problem));
        }
        Ok(more)
    }

    /// Line of the row.
    pub fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    /// The text in a column of the row.
    pub fn text(&self, column: usize) -> String {
        String::from_utf8_lossy(self.record.get(column).unwrap_or_default()).into_owned()
    }

    /// Whether the row has nothing in a column.
    pub fn is_empty(&self, column: usize) -> bool {
        self.record.get(column).is_none_or(<[u8]>::is_empty)
    }

    /// The number in a column of the row.
    pub fn number(&self, column: usize) -> Result<f64, FileError> {
        let text = self.text(column);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(column, Problem::not_allowed(text, "a finite number"))),
        }
    }

    /// The same, within what is allowed.
    pub fn number_within(&self, column: usize, allowed: &RangeInclusive<f64>) -> Result<f64, FileError> {
        let value = self.number(column)?;
        if allowed.contains(&value) {
            return Ok(value);
        }
        let allowed = format!("a number from {} to {}", allowed.start(), allowed.end());
        Err(self.error(column, Problem::not_allowed(self.text(column), allowed)))
    }

    /// Something wrong with a field of the row.
    pub fn error(&self, column: usize, problem: Problem) -> FileError {
        let name = self.header.get(column).cloned().unwrap_or_default();
        FileError::new(&self.path, Place::Field { line: self.line(), column: column + 1, name }, problem)
    }

    /// Something wrong with the file.
    pub fn whole(&self, problem: Problem) -> FileError {
        FileError::whole(&self.path, problem)
    }
}

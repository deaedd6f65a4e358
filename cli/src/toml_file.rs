//! TOML files whose every error names file, line and column.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, Deserializer};

use crate::file_error::{FileError, Place, Problem};

/// The text of a TOML file, kept so that errors found later still know their line.
pub struct TomlFile {
    path: PathBuf,
    text: String,
}

impl TomlFile {
    /// Reads the file; it must be UTF-8.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = fs::read_to_string(path).map_err(|error| FileError::whole(path, error))?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// The whole file as a `T`; its top-level `format` must be `format` and is not handed to `T`.
    pub fn parse_format<T: DeserializeOwned>(&self, format: i64) -> Result<T, FileError> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?;
        let found = table.get_mut().remove("format").ok_or_else(|| self.whole(missing_format(format)))?;
        let span = found.span();
        let number = i64::deserialize(toml::de::ValueDeserializer::from(found)).map_err(|error| self.syntax(&error))?;
        if number != format {
            return Err(self.at(span, Problem::not_allowed(format!("format = {number}"), format!("format = {format}"))));
        }
        self.deserialize(table)
    }

    /// The value of one top-level table as a `T`, the rest unread; `None`: the file has no such table.
    pub fn parse_table<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, FileError> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?;
        let found = table.get_mut().remove(name);
        found
            .map(|value| T::deserialize(toml::de::ValueDeserializer::from(value)))
            .transpose()
            .map_err(|error| self.syntax(&error))
    }

    /// The whole file as a `T`.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        self.deserialize(DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?)
    }

    /// An error at a range of bytes of the text.
    pub fn at(&self, span: Range<usize>, problem: Problem) -> FileError {
        FileError::new(&self.path, self.place(span.start), problem)
    }

    /// An error of the file as a whole.
    pub fn whole(&self, problem: Problem) -> FileError {
        FileError::whole(&self.path, problem)
    }

    fn deserialize<T: DeserializeOwned>(&self, table: Spanned<DeTable<'_>>) -> Result<T, FileError> {
        T::deserialize(Deserializer::from(table)).map_err(|error| self.syntax(&error))
    }

    fn syntax(&self, error: &toml::de::Error) -> FileError {
        let place = error.span().map_or(Place::Whole, |span| self.place(span.start));
        FileError::new(&self.path, place, Problem::Syntax(error.message().trim_end().replace('\n', "; ")))
    }

    fn place(&self, byte: usize) -> Place {
        let before = self.text.get(..byte).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Place::Character {
            line: before.matches('\n').count() as u64 + 1,
            column: before[line_start..].chars().count() as u64 + 1,
        }
    }
}

fn missing_format(format: i64) -> Problem {
    Problem::Syntax(format!("the first line must be `format = {format}`; no format is given"))
}

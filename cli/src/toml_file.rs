//! TOML files whose every error names file, line and column.

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use simulated::lay_over;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use crate::file_error::{FileError, Place, Problem};
use crate::input;

/// The text of a TOML file, kept so that errors found later still know their line.
pub struct TomlFile {
    path: PathBuf,
    text: String,
}

/// The folder of a manifest and its path, given either.
pub fn locate(path: &Path, manifest: &str) -> (PathBuf, PathBuf) {
    if path.is_dir() {
        (path.to_owned(), path.join(manifest))
    } else {
        (path.parent().map_or_else(PathBuf::new, Path::to_owned), path.to_owned())
    }
}

impl TomlFile {
    /// Reads the file; it must be UTF-8.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = input::text(path).map_err(|error| FileError::whole(path, error))?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// Text that did not come from a file of its own; `path` is its name in errors.
    pub fn of_text(path: &Path, text: String) -> Self {
        Self { path: path.to_owned(), text }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it says something of `name` at its top level.
    pub fn has(&self, name: &str) -> Result<bool, FileError> {
        Ok(DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?.get_ref().contains_key(name))
    }

    /// The whole file as a `T`; its top-level `format` must be `format` and is not handed to `T`.
    pub fn parse_format<T: DeserializeOwned>(&self, format: i64) -> Result<T, FileError> {
        self.deserialize(self.without(format..=format, &[])?)
    }

    /// The top-level table `name` as a `T`, where there is one.
    pub fn parse_table<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, FileError> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?;
        let Some(value) = table.get_mut().remove(name) else { return Ok(None) };
        T::deserialize(toml::de::ValueDeserializer::from(value)).map(Some).map_err(|error| self.syntax(&error))
    }

    /// What is in the file but its `format`, which must be `format`, and these tables.
    pub fn without(&self, formats: RangeInclusive<i64>, tables: &[&str]) -> Result<Spanned<DeTable<'_>>, FileError> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?;
        let found = table.get_mut().remove("format").ok_or_else(|| self.whole(missing_format(*formats.end())))?;
        let span = found.span();
        let number = i64::deserialize(toml::de::ValueDeserializer::from(found)).map_err(|error| self.syntax(&error))?;
        if !formats.contains(&number) {
            let allowed: Vec<String> = formats.map(|format| format!("format = {format}")).collect();
            return Err(self.at(span, Problem::not_allowed(format!("format = {number}"), allowed.join(" or "))));
        }
        tables.iter().for_each(|name| drop(table.get_mut().remove(*name)));
        Ok(table)
    }

    /// The whole file as a `T`.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        self.deserialize(DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?)
    }

    /// The top-level table `name` (or, without a name, the whole file) laid over `base`: what it does not say stays as
    /// it is there. A file without that table changes nothing.
    pub fn parse_over<T: Serialize + DeserializeOwned>(&self, base: &T, name: Option<&str>) -> Result<T, FileError> {
        let base = toml::to_string(base).map_err(|error| self.whole(Problem::Syntax(error.to_string())))?;
        let mut merged = DeTable::parse(&base).map_err(|error| self.syntax(&error))?;
        lay_over(merged.get_mut(), self.table(name)?);
        self.deserialize(merged)
    }

    /// An error at the value of `field` (dotted, below the table `name`; tables of a list by their numbers from 0), or of the whole file if it does not say it.
    pub fn at_field(&self, name: Option<&str>, field: &str, problem: Problem) -> FileError {
        match self.table(name).ok().and_then(|table| find(&table, field)) {
            Some(span) => self.at(span, problem),
            None => self.whole(problem),
        }
    }

    /// An error at a range of bytes of the text.
    pub fn at(&self, span: Range<usize>, problem: Problem) -> FileError {
        FileError::new(&self.path, self.place(span.start), problem)
    }

    /// An error of the file as a whole.
    pub fn whole(&self, problem: Problem) -> FileError {
        FileError::whole(&self.path, problem)
    }

    fn table(&self, name: Option<&str>) -> Result<DeTable<'_>, FileError> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error))?.into_inner();
        let Some(name) = name else { return Ok(table) };
        let Some(value) = table.remove(name) else { return Ok(DeTable::new()) };
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Ok(table),
            _ => Err(self.at(span, Problem::Syntax(format!("`{name}` must be a table")))),
        }
    }

    /// A table of this file as a `T`.
    pub fn deserialize<T: DeserializeOwned>(&self, table: Spanned<DeTable<'_>>) -> Result<T, FileError> {
        T::deserialize(Deserializer::from(table)).map_err(|error| self.syntax(&error))
    }

    fn syntax(&self, error: &toml::de::Error) -> FileError {
        let place = error.span().map_or(Place::Whole, |span| self.place(span.start));
        let message = in_plain_words(&error.message().trim_end().replace('\n', "; "));
        let field = error.span().and_then(|span| field_at(DeTable::parse(&self.text).ok()?.get_ref(), &span));
        let problem = field.map_or_else(|| message.clone(), |field| format!("`{field}`: {message}"));
        FileError::new(&self.path, place, Problem::Syntax(problem))
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

/// Where the value of a dotted field stands.
fn find(table: &DeTable<'_>, field: &str) -> Option<Range<usize>> {
    let mut names = field.split('.');
    let mut value = table.get(names.next()?)?;
    for name in names {
        value = match value.get_ref() {
            DeValue::Table(below) => below.get(name)?,
            DeValue::Array(list) => match name.parse::<usize>().ok().and_then(|number| list.get(number)) {
                Some(below) => below,
                None => break,
            },
            _ => break,
        };
    }
    Some(value.span())
}

/// The dotted name of the field whose value stands at a range of the text; of a table in a list, its number from 1.
fn field_at(table: &DeTable<'_>, at: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(name, value)| in_value(value, at).map(|below| format!("{}{below}", name.get_ref())))
}

/// What leads from a value to the one at a range: nothing where it is the value itself.
fn in_value(value: &Spanned<DeValue<'_>>, at: &Range<usize>) -> Option<String> {
    match value.get_ref() {
        DeValue::Table(table) => field_at(table, at).map(|below| format!(".{below}")),
        DeValue::Array(all) => {
            all.iter().enumerate().find_map(|(i, each)| in_value(each, at).map(|below| format!("[{}]{below}", i + 1)))
        }
        _ => (value.span() == *at).then(String::new),
    }
}

/// The names that Rust's numbers have say nothing to those who write a file.
fn in_plain_words(message: &str) -> String {
    let Some((found, expected)) = message.rsplit_once("expected ") else { return message.to_owned() };
    let expected = match expected {
        "f64" | "f32" => "a number",
        "i64" | "i32" | "i16" => "a whole number",
        "u64" | "u32" | "u16" | "u8" | "usize" => "a whole number, 0 or more",
        "a boolean" => "true or false",
        other => other,
    };
    format!("{found}expected {expected}")
}

fn missing_format(format: i64) -> Problem {
    Problem::Syntax(format!("the first line must be `format = {format}`; no format is given"))
}

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

    /// Errors: a number of the table `name`, or of the whole file, that is beyond those of single precision, and would be read as infinite.
    pub fn check_single_precision(&self, name: Option<&str>) -> Result<(), FileError> {
        let table = self.table(name)?;
        match search(&table, "", &|_, value| is_beyond_single_precision(value.get_ref())) {
            Some((field, span)) => {
                let value = format!("{field} = {}", self.text.get(span.clone()).unwrap_or_default());
                Err(self.at(span, Problem::not_allowed(value, "a number within ±3.4e38")))
            }
            None => Ok(()),
        }
    }

    /// An error at a number of `field` that is not allowed. In a list of tables it is the first with that number, or with a list of so many entries.
    pub fn at_number(&self, name: Option<&str>, field: &str, number: f64, allowed: impl Into<String>) -> FileError {
        // What is counted stands in parentheses behind the field.
        let (path, counted) = field.find(" (").map_or((field, ""), |at| field.split_at(at));
        let found = self.table(name).ok().and_then(|table| {
            search(&table, "", &|place, value| {
                without_numbers(place) == path && is_number_or_length(value.get_ref(), number)
            })
        });
        match found {
            Some((place, span)) => self.at(span, Problem::not_allowed(format!("{place}{counted} = {number}"), allowed)),
            None => self.at_field(name, path, Problem::not_allowed(format!("{field} = {number}"), allowed)),
        }
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
        let is_of_list = error.message().starts_with(TOO_LONG);
        let field = error.span().and_then(|span| self.field_at(&span, is_of_list));
        let problem = field.map_or_else(|| message.clone(), |field| format!("`{field}`: {message}"));
        FileError::new(&self.path, place, Problem::Syntax(problem))
    }

    /// The dotted name of the field whose value stands at a range of the text: of a list, or of what is neither a list nor a table.
    fn field_at(&self, at: &Range<usize>, is_list: bool) -> Option<String> {
        let table = DeTable::parse(&self.text).ok()?;
        let found = search(table.get_ref(), "", &|_, value| match value.get_ref() {
            DeValue::Array(_) => is_list && value.span() == *at,
            DeValue::Table(_) => false,
            _ => !is_list && value.span() == *at,
        });
        found.map(|(field, _)| field)
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

/// Whether a value with this dotted name is the one that is looked for.
type IsIt<'a> = &'a dyn Fn(&str, &Spanned<DeValue<'_>>) -> bool;

/// The first value that is looked for: its dotted name, where of a value in a list its number from 1, and its place. `before` is the table's own name.
fn search(table: &DeTable<'_>, before: &str, is_it: IsIt<'_>) -> Option<(String, Range<usize>)> {
    table.iter().find_map(|(name, value)| {
        let joint = if before.is_empty() { "" } else { "." };
        search_value(value, format!("{before}{joint}{}", name.get_ref()), is_it)
    })
}

fn search_value(value: &Spanned<DeValue<'_>>, name: String, is_it: IsIt<'_>) -> Option<(String, Range<usize>)> {
    if is_it(&name, value) {
        return Some((name, value.span()));
    }
    match value.get_ref() {
        DeValue::Table(table) => search(table, &name, is_it),
        DeValue::Array(all) => (1..)
            .zip(all.iter())
            .find_map(|(number, each): (usize, _)| search_value(each, format!("{name}[{number}]"), is_it)),
        _ => None,
    }
}

/// A dotted name without the numbers of values in lists.
fn without_numbers(name: &str) -> String {
    name.split('[').map(|part| part.split_once(']').map_or(part, |(_, rest)| rest)).collect()
}

/// A number that is this one, in single precision at least; a list of so many entries.
fn is_number_or_length(value: &DeValue<'_>, number: f64) -> bool {
    let is_it = |value: f64| value as f32 == number as f32 || value.is_nan() && number.is_nan();
    match value {
        DeValue::Float(text) => text.as_str().parse::<f64>().is_ok_and(is_it),
        DeValue::Integer(text) => text.as_str().parse::<f64>().is_ok_and(is_it),
        DeValue::Array(all) => all.len() as f64 == number,
        _ => false,
    }
}

fn is_beyond_single_precision(value: &DeValue<'_>) -> bool {
    let DeValue::Float(text) = value else { return false };
    let text = text.as_str();
    !text.contains("inf") && text.parse::<f64>().is_ok_and(|number| number.abs() > f64::from(f32::MAX))
}

/// The names that Rust's numbers have say nothing to those who write a file.
fn in_plain_words(message: &str) -> String {
    if let Some(most) = most_entries(message) {
        return format!("more than {most} entries; allowed are {most} at most");
    }
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

/// How a list with more entries than it may have is told: its length to the first that is too many, and [`SEQUENCE`].
const TOO_LONG: &str = "invalid length ";
const SEQUENCE: &str = ", expected a sequence";

fn most_entries(message: &str) -> Option<usize> {
    message.strip_prefix(TOO_LONG)?.strip_suffix(SEQUENCE)?.parse::<usize>().ok()?.checked_sub(1)
}

fn missing_format(format: i64) -> Problem {
    Problem::Syntax(format!("the first line must be `format = {format}`; no format is given"))
}

//! What a recording is read as, whatever its format: records with numbered fields.

use toml::Spanned;

use super::map::Column;
use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

/// A recording, record by record.
pub trait Records {
    /// Goes to the next record: how many records are missing before it, or `None` at the end.
    fn advance(&mut self) -> Result<Option<u32>, FileError>;

    /// Whether the present record vouches for a field.
    fn is_valid(&self, field: usize) -> bool;

    /// A field of the present record; fields count from 0.
    fn number(&self, field: usize) -> Result<f64, FileError>;

    /// A field of the present record that holds a date with a time: in seconds, from a day that is the same for all records.
    fn moment(&self, field: usize) -> Result<f64, FileError>;

    /// An error at the present record.
    fn error(&self, problem: Problem) -> FileError;

    /// An error at a field of the present record.
    fn field_error(&self, field: usize, problem: Problem) -> FileError;

    /// Names of the fields, as far as they have names.
    fn names(&self) -> &[String];

    /// How many fields a record has.
    fn width(&self) -> usize;

    /// How far the file has been read, bytes.
    fn bytes_read(&self) -> u64;

    /// What has been left out so far.
    fn losses(&self) -> Losses;
}

/// What a recording lacks. Everything that is left out is counted here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Losses {
    /// Samples that never came, by their sequence numbers or time stamps.
    pub lost_samples: u64,
    /// Samples that their own status calls not valid.
    pub invalid_samples: u64,
    /// Frames with a wrong check sum (binary formats).
    pub bad_frames: u64,
    /// Bytes that belong to no good frame (binary formats).
    pub skipped_bytes: u64,
}

/// The field of a column that the mapping names.
///
/// Errors, at the column's place in the mapping: no such number, no such name, a name that stands twice.
pub fn field_of(column: &Spanned<Column>, records: &dyn Records, map: &TomlFile) -> Result<usize, FileError> {
    let refuse = |value: String, allowed: String| Err(map.at(column.span(), Problem::not_allowed(value, allowed)));
    match column.get_ref() {
        Column::Number(number) if (1..=records.width()).contains(number) => Ok(number - 1),
        Column::Number(number) => {
            refuse(format!("column {number}"), format!("1 to {}: the recording has so many columns", records.width()))
        }
        Column::Name(name) => {
            let names = records.names();
            let mut places = names.iter().enumerate().filter(|(_, found)| *found == name).map(|(place, _)| place);
            match (places.next(), places.next()) {
                (Some(place), None) => Ok(place),
                (Some(_), Some(_)) => refuse(
                    format!("column {name:?}"),
                    "a name that stands once in the header, or the column's number".into(),
                ),
                (None, _) if names.is_empty() => {
                    refuse(format!("column {name:?}"), "a number: the recording has no header row with names".into())
                }
                (None, _) => refuse(format!("column {name:?}"), format!("a number, or one of {}", names.join(", "))),
            }
        }
    }
}

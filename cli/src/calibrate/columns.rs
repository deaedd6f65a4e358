//! Tables with named columns of numbers.

use std::path::{Path, PathBuf};

use csv::{ByteRecord, ReaderBuilder, Trim};
use quantities::median::median;

use crate::campaign::check_step;
use crate::file_error::{FileError, Place, Problem};
use crate::input;

/// A step of time longer than so many median steps is a gap.
const LONGEST_STEP: f64 = 1.5;

/// A column that is looked for.
#[derive(Clone, Copy, Debug)]
pub enum Column {
    /// Of this name.
    Named(&'static str),
    /// Of this name, or this name and a unit: `ax`, `ax_g`, `ax_raw`.
    WithUnit(&'static str),
}

/// A table of numbers that has been read.
#[derive(Debug)]
pub struct Table<const N: usize> {
    path: PathBuf,
    header: Vec<String>,
    /// Column of each wanted one; `None` for optional ones that are not there.
    places: [Option<usize>; N],
    pub rows: Vec<[f64; N]>,
    lines: Vec<u64>,
}

impl Column {
    fn name(self) -> &'static str {
        match self {
            Self::Named(name) | Self::WithUnit(name) => name,
        }
    }

    fn matches(self, header: &str) -> bool {
        match self {
            Self::Named(name) => header == name,
            Self::WithUnit(name) => {
                header.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
            }
        }
    }
}

/// The header of a file.
///
/// Errors: no such file, nothing in it.
pub fn header(path: &Path) -> Result<Vec<String>, FileError> {
    let mut reader = reader(path)?;
    let record = reader.byte_headers().map_err(|error| csv_error(path, error))?;
    let header: Vec<_> = record.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    if header.is_empty() {
        return Err(FileError::whole(path, Problem::Empty));
    }
    Ok(header)
}

impl<const N: usize> Table<N> {
    /// Reads a file. Of the columns the last `optional` may be missing: their numbers are 0 then, see [`Self::has`].
    ///
    /// Errors: no such file; a column is missing or twice; a row has too many or too few fields, or something that is not a
    /// finite number; no rows.
    pub fn read(path: &Path, columns: [Column; N], optional: usize) -> Result<Self, FileError> {
        let header = header(path)?;
        let mut places = [None; N];
        for (i, (place, column)) in places.iter_mut().zip(columns).enumerate() {
            *place = find(path, &header, column, i + optional >= N)?;
        }
        let mut table = Self { path: path.to_owned(), header, places, rows: Vec::new(), lines: Vec::new() };
        let mut reader = reader(path)?;
        let mut record = ByteRecord::new();
        while reader.read_byte_record(&mut record).map_err(|error| csv_error(path, error))? {
            reader.get_mut().record();
            let line = record.position().map_or(0, csv::Position::line);
            if record.len() == 1 && record.get(0).is_some_and(<[u8]>::is_empty) {
                continue;
            }
            if record.len() != table.header.len() {
                let problem = Problem::Ragged { found: record.len(), expected: table.header.len() };
                return Err(FileError::new(path, Place::Line(line), problem));
            }
            let mut row = [0.0; N];
            for (value, place) in row.iter_mut().zip(table.places) {
                let Some(field) = place else { continue };
                let text = String::from_utf8_lossy(record.get(field).unwrap_or_default());
                *value = match text.parse::<f64>() {
                    Ok(number) if number.is_finite() => number,
                    _ => {
                        let problem = Problem::not_allowed(text, "a finite decimal number");
                        return Err(table.field_error(line, field, problem));
                    }
                };
            }
            table.rows.push(row);
            table.lines.push(line);
        }
        if table.rows.is_empty() {
            return Err(FileError::whole(path, Problem::NoRows));
        }
        Ok(table)
    }

    /// Whether the file has the wanted column number `column`.
    pub fn has(&self, column: usize) -> bool {
        self.places[column].is_some()
    }

    /// That the numbers of a column increase from row to row, and are seconds: times.
    pub fn check_increasing(&self, column: usize) -> Result<(), FileError> {
        for (pair, line) in self.rows.windows(2).zip(&self.lines[1..]) {
            let (previous_s, t_s) = (pair[0][column], pair[1][column]);
            if t_s <= previous_s {
                let problem = Problem::TimeNotIncreasing { t_s, previous_s };
                return Err(self.field_error(*line, self.places[column].unwrap_or_default(), problem));
            }
        }
        let mut steps_s: Vec<f64> = self.rows.windows(2).map(|pair| pair[1][column] - pair[0][column]).collect();
        let usual_s = median(&mut steps_s).unwrap_or(0.0);
        check_step(usual_s).map_err(|problem| FileError::whole(&self.path, problem))
    }

    /// That no rows are missing: no step of a column of times is longer than `LONGEST_STEP` median steps.
    pub fn check_gapless(&self, column: usize) -> Result<(), FileError> {
        let steps = || self.rows.windows(2).map(|pair| pair[1][column] - pair[0][column]);
        let median_s = median(&mut steps().collect::<Vec<_>>()).unwrap_or(0.0);
        match steps().zip(&self.lines[1..]).find(|(step_s, _)| *step_s > LONGEST_STEP * median_s) {
            Some((step_s, line)) => {
                let problem = Problem::not_allowed(
                    format!("a step of {step_s:.4} s"),
                    format!("at most {LONGEST_STEP} median steps of {median_s:.4} s: rows are missing before this one"),
                );
                Err(self.field_error(*line, self.places[column].unwrap_or_default(), problem))
            }
            None => Ok(()),
        }
    }

    fn field_error(&self, line: u64, field: usize, problem: Problem) -> FileError {
        let name = self.header.get(field).cloned().unwrap_or_default();
        FileError::new(&self.path, Place::Field { line, column: field + 1, name }, problem)
    }
}

fn find(path: &Path, header: &[String], column: Column, optional: bool) -> Result<Option<usize>, FileError> {
    let mut found = header.iter().enumerate().filter(|(_, name)| column.matches(name)).map(|(place, _)| place);
    match (found.next(), found.next()) {
        (Some(place), None) => Ok(Some(place)),
        (Some(first), Some(second)) => {
            let name = header[second].clone();
            let place = Place::Field { line: 1, column: second + 1, name: name.clone() };
            Err(FileError::new(path, place, Problem::DuplicateColumn { name, first: first + 1 }))
        }
        (None, _) if optional => Ok(None),
        (None, _) => {
            let problem = Problem::MissingColumn { name: column.name(), found: header.join(", ") };
            Err(FileError::new(path, Place::Line(1), problem))
        }
    }
}

fn reader(path: &Path) -> Result<csv::Reader<input::Records<std::fs::File>>, FileError> {
    let records = input::records(path).map_err(|error| FileError::whole(path, error))?;
    Ok(ReaderBuilder::new().flexible(true).trim(Trim::All).from_reader(records))
}

fn csv_error(path: &Path, error: csv::Error) -> FileError {
    FileError::whole(path, std::io::Error::from(error))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Column; 3] = [Column::Named("t_s"), Column::WithUnit("ax"), Column::Named("temp_c")];

    fn read(text: &str) -> Result<Table<3>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, text).unwrap();
        let table = Table::read(&path, ALL, 1).and_then(|table| table.check_increasing(0).map(|()| table));
        table.map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
    }

    #[test]
    fn columns_are_found_by_name_in_any_order() {
        let table = read("gx,ax_raw,t_s\n9, 5,1\n\n9,6,2\n").unwrap();
        assert_eq!(table.rows, [[1.0, 5.0, 0.0], [2.0, 6.0, 0.0]]);
        assert!(table.has(1) && !table.has(2));
    }

    #[test]
    fn errors_name_line_and_column() {
        for (text, error) in [
            ("t_s,axial\n1,2\n", "a.csv, line 1: column `ax` is missing; the header has: t_s, axial"),
            ("t_s,ax\n1,2\n2\n", "a.csv, line 3: 1 fields; the header has 2"),
            (
                "t_s,ax\n1,2\n2,nan\n",
                "a.csv, line 3, column 2 (ax): \"nan\" is not allowed; allowed is a finite decimal number",
            ),
            (
                "t_s,ax,ax_g\n",
                "a.csv, line 1, column 3 (ax_g): column name \"ax_g\" appears twice; the first is column 2",
            ),
            ("t_s,ax\n", "a.csv: no data rows follow the header"),
        ] {
            assert_eq!(read(text).unwrap_err(), error);
        }
        let backwards = read("t_s,ax\n1,2\n1,3\n").unwrap_err();
        assert!(backwards.starts_with("a.csv, line 3, column 1 (t_s): time 1 is not later"), "{backwards}");
    }

    #[test]
    fn a_gap_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let gap = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Table::<3>::read(&path, ALL, 1).unwrap().check_gapless(0).map_err(|error| error.to_string())
        };
        assert_eq!(gap("t_s,ax\n1,0\n2,0\n3.4,0\n4,0\n"), Ok(()));
        assert_eq!(gap("t_s,ax\n1,0\n"), Ok(()));
        let error = gap("t_s,ax\n1,0\n2,0\n3,0\n5,0\n").unwrap_err();
        let expected = "a.csv, line 5, column 1 (t_s): \"a step of 2.0000 s\" is not allowed; allowed is at most 1.5 \
                        median steps of 1.0000 s: rows are missing before this one";
        assert!(error.ends_with(expected), "{error}");
    }
}

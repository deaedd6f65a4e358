//! Recordings as text: one sample a line.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::map::{Map, Text};
use super::moment;
use super::record::{Losses, Records};
use crate::file_error::{FileError, Place, Problem};

const NUMBER: &str = "a finite decimal number";
const MOMENT: &str = "a date with a time, ISO 8601, such as 2026-05-04T09:00:00.25Z";
/// A text line is not longer than this; a binary file has no newlines to speak of.
const LONGEST_LINE: usize = 1 << 16;

/// Reads a text file line by line.
pub struct TextRecords {
    path: PathBuf,
    reader: BufReader<File>,
    delimiter: Delimiter,
    comment: Vec<u8>,
    decimal_comma: bool,
    /// Lines at the end that are no data: so many are held back.
    footer_rows: usize,
    ahead: VecDeque<(u64, Vec<u8>)>,
    /// The data end at a line that begins so; empty: at the file's end.
    stop_at: Vec<u8>,
    rows_left: u64,
    lines_read: u64,
    /// Rows of the header that are still to be read: among them an empty line is a row, as in an editor.
    header_left: usize,
    /// The line before was a comment, or an empty one below it, which belongs to it.
    below_comment: bool,
    line: Vec<u8>,
    line_number: u64,
    bytes_read: u64,
    fields: Vec<Range<usize>>,
    names: Vec<String>,
    width: usize,
    /// The first record was read to learn the width, and is still to be handed out.
    first: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimiter {
    Byte(u8),
    Whitespace,
}

impl TextRecords {
    /// Opens the file and reads its header and its first record.
    ///
    /// Errors: no such file; a delimiter or a row of names that cannot be; a file that ends before its first record.
    pub fn open(path: &Path, map: &Map) -> Result<Self, FileError> {
        let file = crate::input::open(path).map_err(|error| FileError::whole(path, error))?;
        let Text { comment, header_rows, decimal_comma, footer_rows, stop_at, rows, .. } = map.text.clone();
        let mut reader = BufReader::with_capacity(1 << 16, file);
        refuse_binary(path, reader.fill_buf().map_err(|error| FileError::whole(path, error))?)?;
        let mut records = Self {
            path: path.to_owned(),
            reader,
            delimiter: delimiter(map)?,
            comment: comment.into_bytes(),
            decimal_comma,
            footer_rows,
            ahead: VecDeque::new(),
            stop_at: stop_at.into_bytes(),
            rows_left: rows.map_or(u64::MAX, |rows| rows.into_inner().get()),
            lines_read: 0,
            header_left: header_rows,
            below_comment: false,
            line: Vec::new(),
            line_number: 0,
            bytes_read: 0,
            fields: Vec::new(),
            names: Vec::new(),
            width: 0,
            first: true,
        };
        let names_row = names_row(map)?;
        let names_rows =
            |row: usize, line: &[u8]| names_row.map_or(!line.trim_ascii().is_empty(), |wanted| row == wanted);
        for row in 1..=header_rows {
            if !records.next_line()? {
                return Err(FileError::whole(
                    path,
                    Problem::Syntax(format!("the file ends after {} of its {header_rows} header rows", row - 1)),
                ));
            }
            if names_rows(row, &records.line) {
                records.names = (0..records.fields.len()).map(|field| records.text(field)).collect();
            }
        }
        if !records.next_data_line()? {
            return Err(FileError::whole(path, Problem::NoRows));
        }
        records.width = records.fields.len();
        Ok(records)
    }

    /// The next line of data; `false` at their end, wherever the mapping says that it is.
    fn next_data_line(&mut self) -> Result<bool, FileError> {
        if self.rows_left == 0 {
            return Ok(false);
        }
        self.rows_left -= 1;
        let found = self.next_line()?;
        Ok(found && (self.stop_at.is_empty() || !self.line.trim_ascii().starts_with(&self.stop_at)))
    }

    /// Goes to the next line that is neither empty nor a comment nor one of the footer's, and finds its fields.
    fn next_line(&mut self) -> Result<bool, FileError> {
        while self.ahead.len() <= self.footer_rows {
            if !self.read_line()? {
                return Ok(false);
            }
            let line = std::mem::take(&mut self.line);
            self.ahead.push_back((self.lines_read, line));
        }
        let Some((line_number, line)) = self.ahead.pop_front() else { return Ok(false) };
        (self.line_number, self.line) = (line_number, line);
        self.split();
        Ok(true)
    }

    /// Reads up to the next line that is neither empty nor a comment; in the header an empty one is a row, but below
    /// a comment.
    fn read_line(&mut self) -> Result<bool, FileError> {
        loop {
            self.line.clear();
            let io = |error| FileError::new(&self.path, Place::Line(self.lines_read + 1), Problem::Io(error));
            // A file without newlines must not be read whole.
            loop {
                let chunk = self.reader.fill_buf().map_err(io)?;
                let newline = chunk.iter().position(|&byte| byte == b'\n');
                let taken = newline.map_or(chunk.len(), |at| at + 1);
                self.line.extend_from_slice(&chunk[..taken]);
                self.reader.consume(taken);
                if newline.is_some() || taken == 0 {
                    break;
                }
                if self.line.len() > LONGEST_LINE {
                    let problem =
                        "a line of more than 64 KiB: this is not a text recording (binary logs: --format kvh)";
                    let place = Place::Line(self.lines_read + 1);
                    return Err(FileError::new(&self.path, place, Problem::Syntax(problem.into())));
                }
            }
            if self.line.is_empty() {
                return Ok(false);
            }
            self.lines_read += 1;
            self.bytes_read += self.line.len() as u64;
            if self.lines_read == 1 && self.line.starts_with(b"\xEF\xBB\xBF") {
                self.line.drain(..3);
            }
            let text = self.line.trim_ascii();
            let comment = !self.comment.is_empty() && text.starts_with(&self.comment);
            self.below_comment = comment || (text.is_empty() && self.below_comment);
            let of_header = self.header_left > 0 && !self.below_comment;
            if !comment && (!text.is_empty() || of_header) {
                self.header_left = self.header_left.saturating_sub(1);
                return Ok(true);
            }
        }
    }

    /// Finds the fields of the line. A delimiter between double quotes does not count.
    fn split(&mut self) {
        self.fields.clear();
        let (mut start, mut quoted) = (0, false);
        for (at, &byte) in self.line.iter().enumerate() {
            quoted ^= byte == b'"';
            let ends = !quoted
                && match self.delimiter {
                    Delimiter::Byte(delimiter) => byte == delimiter,
                    Delimiter::Whitespace => byte.is_ascii_whitespace(),
                };
            if ends {
                self.fields.push(start..at);
                start = at + 1;
            }
        }
        self.fields.push(start..self.line.len());
        if self.delimiter == Delimiter::Whitespace {
            self.fields.retain(|field| !field.is_empty());
        }
    }

    /// A field without the blanks and the quotes around it.
    fn bytes(&self, field: usize) -> &[u8] {
        let bytes =
            self.fields.get(field).and_then(|range| self.line.get(range.clone())).unwrap_or_default().trim_ascii();
        match bytes {
            [b'"', inner @ .., b'"'] => inner.trim_ascii(),
            bytes => bytes,
        }
    }

    fn text(&self, field: usize) -> String {
        String::from_utf8_lossy(self.bytes(field)).into_owned()
    }

    fn parse(&self, field: usize) -> Option<f64> {
        let text = std::str::from_utf8(self.bytes(field)).ok()?;
        let value = if self.decimal_comma { text.replacen(',', ".", 1).parse() } else { text.parse::<f64>() };
        value.ok().filter(|value| value.is_finite())
    }
}

impl Records for TextRecords {
    fn advance(&mut self) -> Result<Option<u32>, FileError> {
        if std::mem::take(&mut self.first) {
            return Ok(Some(0));
        }
        if !self.next_data_line()? {
            return Ok(None);
        }
        if self.fields.len() != self.width {
            let problem = Problem::Syntax(format!("{} fields; the first record has {}", self.fields.len(), self.width));
            return Err(self.error(problem));
        }
        Ok(Some(0))
    }

    fn is_valid(&self, _field: usize) -> bool {
        true
    }

    fn number(&self, field: usize) -> Result<f64, FileError> {
        self.parse(field).ok_or_else(|| self.field_error(field, Problem::not_allowed(self.text(field), NUMBER)))
    }

    fn moment(&self, field: usize) -> Result<f64, FileError> {
        let seconds = std::str::from_utf8(self.bytes(field)).ok().and_then(moment::seconds);
        seconds.ok_or_else(|| self.field_error(field, Problem::not_allowed(self.text(field), MOMENT)))
    }

    fn error(&self, problem: Problem) -> FileError {
        FileError::new(&self.path, Place::Line(self.line_number), problem)
    }

    fn field_error(&self, field: usize, problem: Problem) -> FileError {
        let name = self.names.get(field).cloned().unwrap_or_else(|| "no name".into());
        FileError::new(&self.path, Place::Field { line: self.line_number, column: field + 1, name }, problem)
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn width(&self) -> usize {
        self.width
    }

    fn bytes_read(&self) -> u64 {
        self.bytes_read
    }

    fn losses(&self) -> Losses {
        Losses::default()
    }
}

/// An empty file and a binary one are refused by name before any of it is taken for text.
pub fn refuse_binary(path: &Path, head: &[u8]) -> Result<(), FileError> {
    let what = match head {
        [] => return Err(FileError::whole(path, Problem::Syntax("the file is empty".into()))),
        head if crate::input::is_utf16(head) => crate::input::UTF16,
        head if head.starts_with(b"MATLAB 5.0 MAT-file") => {
            "a MATLAB file: write its columns as text there, writematrix(data, \"recording.csv\")"
        }
        [0x89, b'H', b'D', b'F', ..] => "an HDF5 (or MATLAB 7.3) file: export its columns as text",
        [b'P', b'K', 3, 4, ..] => "a zip archive or a spreadsheet: export the sheet as CSV",
        [0x1F, 0x8B, ..] => "a gzip archive: unpack it first",
        head if is_miniseed(head) => {
            "a miniSEED file: write its samples as text, in Python with ObsPy: obspy.read(\"recording.mseed\").write(\"recording.txt\", format=\"TSPAIR\")"
        }
        head if head.contains(&0) => "a binary file, not a text recording (binary logs: --format kvh)",
        _ => return Ok(()),
    };
    Err(FileError::whole(path, Problem::Syntax(format!("this is {what}"))))
}

/// A record of miniSEED 2 begins with a number of six digits, a mark of its quality and a blank, one of miniSEED 3 with MS and a 3.
fn is_miniseed(head: &[u8]) -> bool {
    let numbered = head.get(..6).is_some_and(|number| number.iter().all(u8::is_ascii_digit));
    let marked = matches!(head.get(6..8), Some([b'D' | b'R' | b'Q' | b'M', b' ']));
    head.starts_with(b"MS\x03") || (numbered && marked && head.contains(&0))
}

fn delimiter(map: &Map) -> Result<Delimiter, FileError> {
    let given = &map.text.delimiter;
    let delimiter = match given.get_ref().as_str() {
        "whitespace" => Delimiter::Whitespace,
        "tab" => Delimiter::Byte(b'\t'),
        one if one.len() == 1 && one != "\"" => Delimiter::Byte(one.as_bytes()[0]),
        other => {
            let allowed = "one ASCII character such as \",\", or \"tab\", or \"whitespace\"";
            return Err(map.file.at(given.span(), Problem::not_allowed(format!("delimiter = {other:?}"), allowed)));
        }
    };
    if map.text.decimal_comma && delimiter == Delimiter::Byte(b',') {
        let problem = "with decimal_comma the delimiter must be another than \",\"";
        return Err(map.file.at_field(Some("text"), "decimal_comma", Problem::Syntax(problem.into())));
    }
    Ok(delimiter)
}

/// Which header row, from 1, names the columns, where the mapping says it: otherwise the last that is not empty does.
fn names_row(map: &Map) -> Result<Option<usize>, FileError> {
    match &map.text.names_row {
        None => Ok(None),
        Some(row) if (1..=map.text.header_rows).contains(row.get_ref()) => Ok(Some(*row.get_ref())),
        Some(row) => {
            let allowed = format!("1 to header_rows = {}", map.text.header_rows);
            Err(map.file.at(row.span(), Problem::not_allowed(format!("names_row = {}", row.get_ref()), allowed)))
        }
    }
}

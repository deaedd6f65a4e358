//! Files that are read: only regular ones, and nothing without an end is kept in memory.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Longest record of a table, and with it the longest line.
const LONGEST_RECORD: usize = 16 << 20;
/// Longest file that is read whole.
const LONGEST_TEXT: u64 = 64 << 20;

/// Opens a regular file.
///
/// Errors: there is none; a folder, a device or a pipe, which might never end.
pub fn open(path: &Path) -> io::Result<File> {
    // Looked at first: opening a pipe that nobody writes to would wait for ever.
    let kind = std::fs::metadata(path)?;
    match kind.is_file() {
        true => File::open(path),
        false if kind.is_dir() => Err(io::Error::new(ErrorKind::IsADirectory, "this is a folder, not a file")),
        false => {
            Err(io::Error::new(ErrorKind::InvalidInput, "this is no regular file; copy what it gives to one first"))
        }
    }
}

/// The text of a file.
///
/// Errors: as [`open`]; it is longer than any that is meant, or not UTF-8.
pub fn text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    open(path)?.take(LONGEST_TEXT + 1).read_to_string(&mut text)?;
    match text.len() as u64 > LONGEST_TEXT {
        true => Err(io::Error::new(ErrorKind::InvalidData, "more than 64 MiB: this is not such a file")),
        false => Ok(text),
    }
}

/// Passes the bytes of records on until one of them is too long.
#[derive(Debug)]
pub struct Records<R> {
    inner: R,
    since_record: usize,
}

/// Opens the file of a table.
pub fn records(path: &Path) -> io::Result<Records<File>> {
    Ok(Records { inner: open(path)?, since_record: 0 })
}

impl<R> Records<R> {
    /// A record was read.
    pub fn record(&mut self) {
        self.since_record = 0;
    }
}

impl<R: Read> Read for Records<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.since_record > LONGEST_RECORD {
            let message = "a row of more than 16 MiB, or a quotation mark that is never closed: this is not a table";
            return Err(io::Error::new(ErrorKind::InvalidData, message));
        }
        let count = self.inner.read(bytes)?;
        self.since_record += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_without_an_end_is_refused_and_many_short_ones_are_not() {
        let mut endless = Records { inner: io::repeat(b'7'), since_record: 0 };
        let error = io::copy(&mut endless, &mut io::sink()).unwrap_err();
        assert!(error.to_string().contains("more than 16 MiB"), "{error}");
        let mut bytes = [0; 1 << 16];
        let mut rows = Records { inner: io::repeat(b'\n'), since_record: 0 };
        for _ in 0..1000 {
            rows.read_exact(&mut bytes).unwrap();
            rows.record();
        }
    }

    #[test]
    fn what_might_never_end_is_refused_at_once() {
        for (path, why) in [("/dev/zero", "no regular file"), ("/", "folder"), ("/nowhere", "No such file")] {
            assert!(text(Path::new(path)).unwrap_err().to_string().contains(why), "{path}");
        }
    }
}

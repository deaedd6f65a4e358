//! Files that are read: only regular ones, and nothing without an end is kept in memory.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek};
use std::path::Path;

/// Longest record of a table, and with it the longest line.
const LONGEST_RECORD: usize = 16 << 20;
/// Within so many bytes the first line of a table ends.
const FIRST_LINE: u64 = 1 << 16;
/// Longest file that is read whole.
const LONGEST_TEXT: u64 = 64 << 20;
/// What a file in UTF-16 is, and what to do about it.
pub const UTF16: &str = "UTF-16 text: convert it to UTF-8, for instance with iconv -f UTF-16 -t UTF-8";

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
/// Errors: as [`open`]; it is longer than any that is meant, UTF-16, or not UTF-8.
pub fn text(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    open(path)?.take(LONGEST_TEXT + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LONGEST_TEXT {
        return Err(io::Error::new(ErrorKind::InvalidData, "more than 64 MiB: this is not such a file"));
    }
    refuse_utf16(&bytes)?;
    String::from_utf8(bytes).map_err(|_| io::Error::new(ErrorKind::InvalidData, "this is not valid UTF-8 text"))
}

/// Passes the bytes of records on until one of them is too long; where lines end with carriage returns alone, as a newline each.
#[derive(Debug)]
pub struct Records<R> {
    inner: R,
    since_record: usize,
    carriage_returns: bool,
}

/// Opens the file of a table.
///
/// Errors: as [`open`]; it is UTF-16 text.
pub fn records(path: &Path) -> io::Result<Records<File>> {
    let mut inner = open(path)?;
    let mut begin = Vec::new();
    (&inner).take(FIRST_LINE).read_to_end(&mut begin)?;
    inner.rewind()?;
    refuse_utf16(&begin)?;
    Ok(Records { inner, since_record: 0, carriage_returns: ends_with_carriage_return(&begin) })
}

/// It begins with a byte-order mark, or each other byte of its first characters is zero.
pub fn is_utf16(head: &[u8]) -> bool {
    const CHARACTERS: usize = 8;
    let zeros = |first: usize| head.iter().skip(first).step_by(2).take(CHARACTERS).filter(|byte| **byte == 0).count();
    let text = |zero: usize, other: usize| zeros(zero) == CHARACTERS && zeros(other) == 0;
    head.starts_with(b"\xFF\xFE") || head.starts_with(b"\xFE\xFF") || text(0, 1) || text(1, 0)
}

fn refuse_utf16(head: &[u8]) -> io::Result<()> {
    match is_utf16(head) {
        true => Err(io::Error::new(ErrorKind::InvalidData, format!("this is {UTF16}"))),
        false => Ok(()),
    }
}

/// Whether the first line ends with a carriage return and no newline.
fn ends_with_carriage_return(text: &[u8]) -> bool {
    let end = text.iter().position(|byte| matches!(byte, b'\r' | b'\n'));
    end.and_then(|end| text.get(end..)).is_some_and(|end| end.starts_with(b"\r") && !end.starts_with(b"\r\n"))
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
        if self.carriage_returns {
            bytes.iter_mut().take(count).filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
        }
        self.since_record += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_without_an_end_is_refused_and_many_short_ones_are_not() {
        let mut endless = Records { inner: io::repeat(b'7'), since_record: 0, carriage_returns: false };
        let error = io::copy(&mut endless, &mut io::sink()).unwrap_err();
        assert!(error.to_string().contains("more than 16 MiB"), "{error}");
        let mut bytes = [0; 1 << 16];
        let mut rows = Records { inner: io::repeat(b'\n'), since_record: 0, carriage_returns: false };
        for _ in 0..1000 {
            rows.read_exact(&mut bytes).unwrap();
            rows.record();
        }
    }

    #[test]
    fn lines_may_end_with_a_carriage_return_a_newline_or_both() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        for (written, read) in
            [("a,b\r1,2\r", "a,b\n1,2\n"), ("a,b\r\n1,2\r\n", "a,b\r\n1,2\r\n"), ("a\n1\r", "a\n1\r")]
        {
            std::fs::write(&path, written).unwrap();
            let mut text = String::new();
            records(&path).unwrap().read_to_string(&mut text).unwrap();
            assert_eq!(text, read);
        }
    }

    #[test]
    fn tables_and_texts_in_utf_16_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let written = || "t_s,index_deg\n".encode_utf16();
        let little: Vec<u8> = written().flat_map(u16::to_le_bytes).collect();
        let marked_big: Vec<u8> = std::iter::once(0xFEFF).chain(written()).flat_map(u16::to_be_bytes).collect();
        for bytes in [little, marked_big] {
            std::fs::write(&path, bytes).unwrap();
            for error in [records(&path).unwrap_err(), text(&path).unwrap_err()] {
                assert!(error.to_string().contains("UTF-16 text: convert it"), "{error}");
            }
        }
        std::fs::write(&path, b"title = \"\xE9t\xE9\"\n").unwrap();
        let error = text(&path).unwrap_err();
        assert!(error.to_string().contains("not valid UTF-8"), "{error}");
    }

    #[test]
    fn what_might_never_end_is_refused_at_once() {
        for (path, why) in [("/dev/zero", "no regular file"), ("/", "folder"), ("/nowhere", "No such file")] {
            assert!(text(Path::new(path)).unwrap_err().to_string().contains(why), "{path}");
        }
    }
}

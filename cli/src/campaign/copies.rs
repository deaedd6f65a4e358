//! Recordings that are there twice under two names: what is learned from them would count twice.

use std::collections::HashMap;
use std::io::{self, BufReader, Read};
use std::path::Path;

use super::Campaign;
use crate::file_error::{FileError, Problem};

impl Campaign {
    /// Errors: a run's file has the very bytes of an earlier one; a file cannot be read.
    pub fn check_copies(&self) -> Result<(), FileError> {
        let mut by_size: HashMap<u64, Vec<&str>> = HashMap::new();
        for run in &self.runs {
            let path = self.path_of(run);
            let unreadable = |error| FileError::whole(&path, error);
            let size = path.metadata().map_err(unreadable)?.len();
            let alike = by_size.entry(size).or_default();
            for &earlier in alike.iter() {
                if size > 0 && same_bytes(&path, &self.folder.join(earlier)).map_err(unreadable)? {
                    return Err(FileError::whole(&path, Problem::CopyOf(earlier.to_owned())));
                }
            }
            alike.push(&run.file);
        }
        Ok(())
    }
}

/// Whether two files of the same size hold the same; reads no further than the first difference.
fn same_bytes(one: &Path, other: &Path) -> io::Result<bool> {
    let bytes = |path| Ok::<_, io::Error>(BufReader::new(crate::input::open(path)?).bytes());
    for (one, other) in bytes(one)?.zip(bytes(other)?) {
        if one? != other? {
            return Ok(false);
        }
    }
    Ok(true)
}

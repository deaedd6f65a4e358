//! Where a command's results go: for people to stdout, for programs to a file or, instead of the other, to stdout.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use crate::failure::Failure;
use crate::file_error::FileError;

/// The option that every command with a result has.
#[derive(Args, Clone, Debug, Default)]
pub struct JsonOption {
    /// Write the machine-readable result to FILE; "-" is stdout, which then carries nothing else
    #[arg(long = "json", value_name = "FILE", global = true)]
    file: Option<PathBuf>,
}

impl JsonOption {
    /// Where text for people goes: nowhere, when stdout carries the machine-readable result.
    pub fn human(&self) -> Box<dyn Write> {
        if self.is_stdout() { Box::new(io::sink()) } else { Box::new(io::stdout()) }
    }

    /// Writes the machine-readable result, if it was asked for. Every digit of every number is kept.
    pub fn write(&self, value: &impl Serialize) -> Result<(), Failure> {
        let Some(path) = &self.file else { return Ok(()) };
        if self.is_stdout() {
            return Ok(write_json(&mut io::stdout().lock(), value)?);
        }
        let write = || write_json(&mut BufWriter::new(File::create(path)?), value);
        write().map_err(|error| FileError::whole(path, error).into())
    }

    fn is_stdout(&self) -> bool {
        self.file.as_deref() == Some(Path::new("-"))
    }
}

/// Creates a file that is not there yet.
pub fn create(path: &Path) -> io::Result<File> {
    File::create_new(path).map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => io::Error::new(error.kind(), "the file exists, and nothing is overwritten"),
        _ => error,
    })
}

fn write_json(writer: &mut impl Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *writer, value).map_err(io::Error::from)?;
    writeln!(writer)?;
    writer.flush()
}

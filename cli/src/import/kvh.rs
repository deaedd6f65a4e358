//! Binary logs of the KVH 1750 family, format A: frames as they came from the gyro's serial line.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use north_finder::sensing::frame::kvh::{KvhFrame, KvhReader};

use super::record::{Losses, Records};
use crate::file_error::{FileError, Problem};

/// The fields of a frame, by the names that a mapping calls them.
const NAMES: [&str; 8] = ["gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z", "temp_c", "sequence"];
/// So many bytes without a good frame are no log of such a gyro: at 36 bytes a frame and 1000 Hz they are eight minutes.
const LONGEST_NOISE: u64 = 16 << 20;
/// Sequence numbers run from 0 to this minus one.
const MODULUS: u16 = 128;

/// Reads a binary log frame by frame.
pub struct KvhRecords {
    path: PathBuf,
    reader: BufReader<File>,
    frames: KvhReader,
    names: Vec<String>,
    frame: Option<KvhFrame>,
    number: u64,
    lost: u64,
    bytes_read: u64,
}

impl KvhRecords {
    /// Opens the file.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = crate::input::open(path).map_err(|error| FileError::whole(path, error))?;
        Ok(Self {
            path: path.to_owned(),
            reader: BufReader::with_capacity(1 << 16, file),
            frames: KvhReader::default(),
            names: NAMES.map(str::to_owned).to_vec(),
            frame: None,
            number: 0,
            lost: 0,
            bytes_read: 0,
        })
    }

    fn next_frame(&mut self) -> Result<Option<KvhFrame>, FileError> {
        let begin = self.bytes_read;
        loop {
            let chunk = self.reader.fill_buf().map_err(|error| FileError::whole(&self.path, error))?;
            if chunk.is_empty() {
                return Ok(None);
            }
            if self.bytes_read - begin > LONGEST_NOISE {
                return Err(self.no_frame(begin));
            }
            let mut taken = 0;
            let frame = chunk.iter().find_map(|&byte| {
                taken += 1;
                self.frames.push(byte)
            });
            self.reader.consume(taken);
            self.bytes_read += taken as u64;
            if frame.is_some() {
                return Ok(frame);
            }
        }
    }

    /// Nothing but noise since this byte.
    fn no_frame(&self, begin: u64) -> FileError {
        let place = if begin == 0 { String::new() } else { format!(" after byte {begin}") };
        let problem = format!(
            "no frame of KVH format A in {} bytes{place}, {} check sums wrong",
            self.bytes_read - begin,
            self.frames.bad_crc()
        );
        FileError::whole(&self.path, Problem::Syntax(problem))
    }
}

impl Records for KvhRecords {
    /// Missing frames are told by the sequence numbers, modulo 128: a gap of exactly 128 frames looks like none. The
    /// check against the recording's duration sees that too.
    fn advance(&mut self) -> Result<Option<u32>, FileError> {
        let Some(frame) = self.next_frame()? else {
            return match self.frame {
                Some(_) => Ok(None),
                None => Err(self.no_frame(0)),
            };
        };
        let previous = self.frame.replace(frame);
        self.number += 1;
        let missing = previous.map_or(0, |previous| {
            (u16::from(frame.sequence) + 2 * MODULUS - 1 - u16::from(previous.sequence)) % MODULUS
        });
        self.lost += u64::from(missing);
        Ok(Some(missing.into()))
    }

    fn is_valid(&self, field: usize) -> bool {
        self.frame.is_some_and(|frame| match field {
            0..=2 => frame.gyro_valid(field),
            3..=5 => frame.acceleration_valid(field - 3),
            _ => true,
        })
    }

    fn moment(&self, field: usize) -> Result<f64, FileError> {
        // A mapping with a column of time is refused for these frames, which have none.
        self.number(field)
    }

    fn number(&self, field: usize) -> Result<f64, FileError> {
        let frame = self.frame.as_ref();
        let value = frame.and_then(|frame| match field {
            0..=2 => frame.gyro.get(field).copied().map(f64::from),
            3..=5 => frame.acceleration_g.get(field - 3).copied().map(f64::from),
            6 => Some(frame.temp_c.into()),
            _ => Some(frame.sequence.into()),
        });
        value.ok_or_else(|| self.error(Problem::NoRows))
    }

    fn error(&self, problem: Problem) -> FileError {
        FileError::whole(&self.path, Problem::Syntax(format!("frame {}: {problem}", self.number)))
    }

    fn field_error(&self, field: usize, problem: Problem) -> FileError {
        let name = NAMES.get(field).unwrap_or(&"no name");
        FileError::whole(&self.path, Problem::Syntax(format!("frame {}, {name}: {problem}", self.number)))
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn width(&self) -> usize {
        NAMES.len()
    }

    fn bytes_read(&self) -> u64 {
        self.bytes_read
    }

    fn losses(&self) -> Losses {
        Losses {
            lost_samples: self.lost,
            invalid_samples: 0,
            bad_frames: self.frames.bad_crc().into(),
            skipped_bytes: self.frames.bytes_skipped().into(),
        }
    }
}

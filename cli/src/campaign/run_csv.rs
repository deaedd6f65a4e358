//! A run as a CSV file, read row by row: recordings at 400 Hz are larger than memory should be.

use std::fs::File;
use std::io::{Chain, Read};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator, Trim};
use quantities::median::median;

use north_finder::effects::channel::LEVEL_TEMPERATURE;
use north_finder::sensing::level::Specific;

use super::clock;
use super::own::{self, MOMENTS, Own, UP};
use crate::file_error::{FileError, Place, Problem};
use crate::input;

/// One row of a run, its interval worked out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// End of the interval, seconds from the run's start; increases from row to row.
    pub t_s: f64,
    /// Length of the interval, seconds, positive.
    pub interval_s: f64,
    /// Measured index angle, degrees counter-clockwise from above; may pass 360 or be negative.
    pub index_deg: f64,
    /// Gyro angle increment over the interval, arcsec.
    pub fog_arcsec: f64,
    /// Gyro temperature, °C.
    pub temp_c: Option<f64>,
    /// Level accelerometers, g.
    pub level: Option<Specific>,
    /// Their temperature, °C.
    pub level_temp_c: Option<f64>,
    /// Frames of this interval that never came or were not valid; 0 where the file does not say.
    pub lost_frames: u16,
    /// In a recording of the instrument: what it says beyond that.
    pub own: Option<Own>,
    /// The extra channels, in the order of [`RunReader::channels`].
    pub extra: Vec<f64>,
}

/// Which field of the file is what.
#[derive(Debug)]
struct Columns {
    t_s: usize,
    index_deg: usize,
    fog_arcsec: usize,
    temp_c: Option<usize>,
    level_g: Option<[usize; 2]>,
    level_temp_c: Option<usize>,
    lost_frames: Option<usize>,
    own: Option<OwnColumns>,
    extra: Vec<usize>,
}

/// Which field is what, in a recording of the instrument.
#[derive(Clone, Copy, Debug)]
struct OwnColumns {
    read: usize,
    dwell: usize,
    gate: usize,
    rest: OwnRest,
}

#[derive(Clone, Copy, Debug)]
enum OwnRest {
    Moments([usize; 3]),
    Up(usize),
}

/// Reads a run row by row; an iterator that ends after the first error.
#[derive(Debug)]
pub struct RunReader {
    path: PathBuf,
    csv: Reader<Source>,
    header: Vec<String>,
    channels: Vec<String>,
    columns: Columns,
    record: ByteRecord,
    previous_s: Option<f64>,
    /// Steps of time so far, until one is short enough to be one.
    long_steps: Option<u32>,
    /// Interval of a first row that stands at 0, or later than any step is long.
    median_step_s: Option<f64>,
    ended: bool,
}

/// The file and a newline after it: with it every record ends with one, which makes the line count simple and exact.
type Source = Chain<input::Records<File>, &'static [u8]>;

const NUMBER: &str = "a finite decimal number";
/// No recording begins later than this after the run's start, seconds: effects of time since then are over, and other times have another zero.
const LATEST_BEGIN_S: f64 = 86_400.0;

impl RunReader {
    /// Opens a run and reads its header.
    ///
    /// If the first row stands at 0, or later than any step is long, the file is read through once, because that row's interval is the median step.
    /// Errors: no such file, no header, a column missing, unnamed or twice, no rows, times that are not those since the run's start.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let mut first = Self::open_without_median(path)?;
        let Some(begin_s) = first.next_time()? else { return Err(FileError::whole(path, Problem::NoRows)) };
        if begin_s > LATEST_BEGIN_S {
            let allowed = format!(
                "0 to {LATEST_BEGIN_S} in the first row: seconds from the run's start, and not from another zero"
            );
            return Err(first.field_error(first.columns.t_s, Problem::not_allowed(begin_s, allowed)));
        }
        let mut reader = Self::open_without_median(path)?;
        if begin_s == 0.0 || clock::check_step(begin_s).is_err() {
            reader.median_step_s = Some(first.median_of_remaining_steps()?);
        }
        Ok(reader)
    }

    /// Names of the extra channels, in the file's order.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// Whether the file has a temperature column.
    pub fn has_temperature(&self) -> bool {
        self.columns.temp_c.is_some()
    }

    /// Whether the file has both level accelerometers.
    pub fn has_level(&self) -> bool {
        self.columns.level_g.is_some()
    }

    fn open_without_median(path: &Path) -> Result<Self, FileError> {
        let file = input::records(path).map_err(|error| FileError::whole(path, error))?;
        // A carriage return before the newline is trimmed like any other white space.
        let mut csv = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .terminator(Terminator::Any(b'\n'))
            .from_reader(file.chain(&b"\n"[..]));
        let mut record = ByteRecord::new();
        if !csv.read_byte_record(&mut record).map_err(|error| csv_error(path, error))? {
            return Err(FileError::whole(path, Problem::Empty));
        }
        let header = read_header(path, &record)?;
        let columns = Columns::find(path, &header)?;
        let channels = columns.extra.iter().filter_map(|&i| header.get(i).cloned()).collect();
        let path = path.to_owned();
        let (previous_s, long_steps, median_step_s) = (None, Some(0), None);
        Ok(Self { path, csv, header, channels, columns, record, previous_s, long_steps, median_step_s, ended: false })
    }

    fn next_row(&mut self) -> Result<Option<Row>, FileError> {
        let previous_s = self.previous_s;
        let Some(t_s) = self.next_time()? else { return Ok(None) };
        let interval_s = match (previous_s, self.median_step_s) {
            (Some(previous_s), _) => t_s - previous_s,
            (None, Some(median_s)) => median_s,
            (None, None) => t_s,
        };
        let level = match self.columns.level_g {
            Some([forward, left]) => Some(Specific { forward: self.number(forward)?, left: self.number(left)? }),
            None => None,
        };
        let own = self.columns.own.map(|columns| self.own(columns)).transpose()?;
        Ok(Some(Row {
            t_s,
            interval_s: own.map_or(interval_s, |own| own.interval_s()),
            own,
            index_deg: self.number(self.columns.index_deg)?,
            fog_arcsec: self.number(self.columns.fog_arcsec)?,
            temp_c: self.columns.temp_c.map(|column| self.number(column)).transpose()?,
            level,
            level_temp_c: self.columns.level_temp_c.map(|column| self.number(column)).transpose()?,
            lost_frames: self.columns.lost_frames.map_or(Ok(0), |column| self.whole_number(column))?,
            extra: self.columns.extra.iter().map(|&column| self.number(column)).collect::<Result<_, _>>()?,
        }))
    }

    fn own(&self, columns: OwnColumns) -> Result<Own, FileError> {
        let small = |column: usize, most: u16| match self.whole_number(column)? {
            number if number <= most => Ok(number as u8),
            number => Err(self.field_error(column, Problem::not_allowed(number.to_string(), format!("0 to {most}")))),
        };
        let read = small(columns.read, 7)?;
        let mark = own::mark(small(columns.dwell, 255)?, small(columns.gate, 3)?).unwrap_or_default();
        Ok(match columns.rest {
            OwnRest::Moments([fog, forward, left]) => Own::Second {
                read,
                mark,
                moment_arcsec_s: self.number(fog)?,
                level_moment: Specific { forward: self.number(forward)?, left: self.number(left)? },
            },
            OwnRest::Up(up) => Own::Raw { read, mark, az_g: self.number(up)? },
        })
    }

    /// Reads the next record and its time, which must be later than that before.
    fn next_time(&mut self) -> Result<Option<f64>, FileError> {
        loop {
            if !self.csv.read_byte_record(&mut self.record).map_err(|error| csv_error(&self.path, error))? {
                return Ok(None);
            }
            self.csv.get_mut().get_mut().0.record();
            let blank = self.record.len() == 1 && self.record.get(0).is_some_and(<[u8]>::is_empty);
            if !blank {
                break;
            }
        }
        if self.record.len() != self.header.len() {
            let problem = Problem::Ragged { found: self.record.len(), expected: self.header.len() };
            return Err(FileError::new(&self.path, Place::Line(self.line()), problem));
        }
        let column = self.columns.t_s;
        let t_s = self.number(column)?;
        match self.previous_s {
            None if t_s < 0.0 => {
                let problem = Problem::not_allowed(t_s, "0 or more: seconds from the run's start");
                Err(self.field_error(column, problem))
            }
            Some(previous_s) if t_s <= previous_s => {
                Err(self.field_error(column, Problem::TimeNotIncreasing { t_s, previous_s }))
            }
            previous_s => {
                let checked = previous_s.map_or(Ok(()), |previous_s| self.check_step(t_s - previous_s));
                checked.map_err(|problem| self.field_error(column, problem))?;
                self.previous_s = Some(t_s);
                Ok(Some(t_s))
            }
        }
    }

    /// One long step is a gap; two before any short one are times in another unit.
    fn check_step(&mut self, step_s: f64) -> Result<(), Problem> {
        match (self.long_steps, clock::check_step(step_s)) {
            (Some(_), Ok(())) => self.long_steps = None,
            (Some(0), Err(_)) => self.long_steps = Some(1),
            (Some(_), Err(problem)) => return Err(problem),
            (None, _) => {}
        }
        clock::check_gap(step_s)
    }

    fn median_of_remaining_steps(&mut self) -> Result<f64, FileError> {
        let mut steps_s = Vec::new();
        while let (Some(previous_s), Some(t_s)) = (self.previous_s, self.next_time()?) {
            steps_s.push(t_s - previous_s);
        }
        median(&mut steps_s).ok_or_else(|| FileError::whole(&self.path, Problem::NoInterval))
    }

    fn number(&self, column: usize) -> Result<f64, FileError> {
        let text = self.text(column);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.field_error(column, Problem::not_allowed(text, NUMBER))),
        }
    }

    /// A whole number; a decimal point with zeros after it does no harm.
    fn whole_number(&self, column: usize) -> Result<u16, FileError> {
        let value = self.number(column)?;
        if value.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&value) {
            Ok(value as u16)
        } else {
            let problem = Problem::not_allowed(self.text(column), "a whole number from 0 to 65535");
            Err(self.field_error(column, problem))
        }
    }

    fn text(&self, column: usize) -> String {
        String::from_utf8_lossy(self.record.get(column).unwrap_or_default()).into_owned()
    }

    /// The line that the last record ended on: the reader stands at the beginning of the next.
    pub fn line(&self) -> u64 {
        self.csv.position().line() - 1
    }

    fn field_error(&self, column: usize, problem: Problem) -> FileError {
        let name = self.header.get(column).cloned().unwrap_or_default();
        FileError::new(&self.path, Place::Field { line: self.line(), column: column + 1, name }, problem)
    }
}

impl Iterator for RunReader {
    type Item = Result<Row, FileError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let row = self.next_row().transpose();
        self.ended = !matches!(row, Some(Ok(_)));
        row
    }
}

impl Columns {
    fn find(path: &Path, header: &[String]) -> Result<Self, FileError> {
        let find = |name: &str| header.iter().position(|column| column == name);
        let need = |name: &'static str| {
            find(name).ok_or_else(|| {
                let problem = Problem::MissingColumn { name, found: header.join(", ") };
                FileError::new(path, Place::Line(1), problem)
            })
        };
        let mut columns = Self {
            t_s: need("t_s")?,
            index_deg: need("index_deg")?,
            fog_arcsec: need("fog_arcsec")?,
            temp_c: find("temp_c"),
            // One level accelerometer alone is an extra channel: half a tilt corrects nothing.
            level_g: find("ax_g").zip(find("ay_g")).map(|(forward, left)| [forward, left]),
            level_temp_c: find(LEVEL_TEMPERATURE),
            lost_frames: find("lost_frames"),
            own: None,
            extra: Vec::new(),
        };
        columns.own = columns.find_own(header);
        let known = [Some(columns.t_s), Some(columns.index_deg), Some(columns.fog_arcsec)]
            .into_iter()
            .chain([columns.temp_c, columns.level_temp_c, columns.lost_frames])
            .chain(columns.level_g.into_iter().flatten().map(Some))
            .flatten()
            .chain(columns.own.iter().flat_map(OwnColumns::all))
            .collect::<Vec<_>>();
        columns.extra = (0..header.len()).filter(|column| !known.contains(column)).collect();
        Ok(columns)
    }

    /// The columns of a recording of the instrument, if all of them are there: one alone is an extra channel.
    fn find_own(&self, header: &[String]) -> Option<OwnColumns> {
        let find = |name: &str| header.iter().position(|column| column == name);
        self.level_g.and(self.lost_frames)?;
        let moments = || Some(OwnRest::Moments([find(MOMENTS[0])?, find(MOMENTS[1])?, find(MOMENTS[2])?]));
        Some(OwnColumns {
            read: find("read")?,
            dwell: find("dwell")?,
            gate: find("gate")?,
            rest: moments().or_else(|| find(UP).map(OwnRest::Up))?,
        })
    }
}

impl OwnColumns {
    fn all(&self) -> Vec<usize> {
        let rest = match &self.rest {
            OwnRest::Moments(moments) => moments.as_slice(),
            OwnRest::Up(up) => std::slice::from_ref(up),
        };
        [self.read, self.dwell, self.gate].iter().chain(rest).copied().collect()
    }
}

fn read_header(path: &Path, record: &ByteRecord) -> Result<Vec<String>, FileError> {
    let mut header: Vec<String> = Vec::with_capacity(record.len());
    for (i, name) in record.iter().enumerate() {
        let name = String::from_utf8_lossy(name).into_owned();
        let problem = match header.iter().position(|earlier| *earlier == name) {
            _ if name.is_empty() => Problem::UnnamedColumn,
            Some(first) => Problem::DuplicateColumn { name: name.clone(), first: first + 1 },
            None => {
                header.push(name);
                continue;
            }
        };
        return Err(FileError::new(path, Place::Field { line: 1, column: i + 1, name }, problem));
    }
    Ok(header)
}

/// Bytes are read and rows may have any length: all that can fail is the reading itself.
fn csv_error(path: &Path, error: csv::Error) -> FileError {
    FileError::whole(path, std::io::Error::from(error))
}

//! A run's file that is written while the run is measured.

use std::path::{Path, PathBuf};

use north_finder::instrument::replay::Mark;
use north_finder::sensing::level::Specific;

use crate::campaign::{COMMON, Layout, Own, OwnLayout, Row, RunWriter, TEMPERATURE};
use crate::file_error::FileError;
use crate::output;

/// The file of one run. Rows are on the disk as soon as they are pushed, once every sensor has given a reading.
///
/// Where a sensor was not read, its last reading is repeated, or the first one before that: the format has no empty fields.
pub struct RunFile {
    path: PathBuf,
    /// The columns are settled when every sensor has given a reading, and after this time at the latest, seconds.
    patience_s: f64,
    /// Names of the rows' further channels.
    names: Vec<String>,
    waiting: Vec<Row>,
    open: Option<Open>,
}

/// A file whose columns are settled.
struct Open {
    writer: RunWriter,
    layout: Layout,
    /// Which of the rows' further channels are columns.
    places: Vec<usize>,
    last: Readings,
    rows: usize,
    /// Rows from the beginning whose marks are of a fix that was given up.
    of_earlier_fix: usize,
}

/// The last readings.
struct Readings {
    temp_c: Option<f64>,
    index_deg: f64,
    level: Specific,
    level_temp_c: Option<f64>,
    extra: Vec<f64>,
}

impl RunFile {
    /// A file at `path`, which must not exist; nothing is created before the first row.
    pub fn new(path: PathBuf, patience_s: f64, names: Vec<String>) -> Self {
        Self { path, patience_s, names, waiting: Vec::new(), open: None }
    }

    /// Writes rows.
    pub fn push(&mut self, rows: impl IntoIterator<Item = Row>) -> Result<(), FileError> {
        self.waiting.extend(rows);
        if self.open.is_none() && !settled(&self.waiting, self.patience_s) {
            return Ok(());
        }
        self.write_waiting()
    }

    /// A recording holds one fix, the last that was started: what came before is only the error model's past.
    pub fn start_again(&mut self) {
        self.waiting.iter_mut().for_each(unmark);
        if let Some(open) = &mut self.open {
            open.of_earlier_fix = open.rows;
        }
    }

    /// Brings everything to the disk; gives the number of rows.
    pub fn finish(mut self) -> Result<usize, FileError> {
        self.write_waiting()?;
        let Some(open) = self.open else { return Ok(0) };
        open.writer.finish()?;
        if open.of_earlier_fix > 0 {
            clear_marks(&self.path, open.of_earlier_fix).map_err(|error| FileError::whole(&self.path, error))?;
        }
        Ok(open.rows)
    }

    fn write_waiting(&mut self) -> Result<(), FileError> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let open = match &mut self.open {
            Some(open) => open,
            none => none.insert(Open::create(&self.path, &self.names, &self.waiting)?),
        };
        for row in self.waiting.drain(..) {
            open.write(row)?;
        }
        open.writer.flush()
    }
}

impl Open {
    fn create(path: &Path, names: &[String], rows: &[Row]) -> Result<Self, FileError> {
        let first =
            |place: usize| rows.iter().filter_map(|row| row.extra.get(place)).copied().find(|value| value.is_finite());
        let (places, extra): (Vec<usize>, Vec<f64>) =
            (0..names.len()).filter_map(|place| Some((place, first(place)?))).unzip();
        let last = Readings {
            temp_c: rows.iter().find_map(|row| row.temp_c),
            index_deg: rows.iter().map(|row| row.index_deg).find(|deg| deg.is_finite()).unwrap_or(0.0),
            level: rows.iter().find_map(|row| row.level).unwrap_or_default(),
            level_temp_c: rows.iter().find_map(|row| row.level_temp_c),
            extra,
        };
        let layout = Layout {
            temperature: last.temp_c.is_some(),
            level: true,
            level_temperature: last.level_temp_c.is_some(),
            lost_frames: true,
            own: Some(if rows.iter().any(is_frame) { OwnLayout::Frames } else { OwnLayout::Seconds }),
            extra: places.iter().map(|&place| names[place].clone()).collect(),
        };
        let writer = RunWriter::create(path, layout.clone())?;
        Ok(Self { writer, layout, places, last, rows: 0, of_earlier_fix: 0 })
    }

    fn write(&mut self, mut row: Row) -> Result<(), FileError> {
        let last = &mut self.last;
        last.temp_c = row.temp_c.or(last.temp_c);
        last.level = row.level.unwrap_or(last.level);
        last.level_temp_c = row.level_temp_c.or(last.level_temp_c);
        if row.index_deg.is_finite() {
            last.index_deg = row.index_deg;
        }
        for (last, &place) in last.extra.iter_mut().zip(&self.places) {
            *last = row.extra.get(place).copied().filter(|value| value.is_finite()).unwrap_or(*last);
        }
        (row.temp_c, row.level, row.level_temp_c) = (last.temp_c, Some(last.level), last.level_temp_c);
        (row.index_deg, row.extra) = (last.index_deg, last.extra.clone());
        if let Some(Own::Second { read, .. } | Own::Raw { read, .. }) = &mut row.own
            && !self.layout.temperature
        {
            *read &= !TEMPERATURE;
        }
        self.writer.write(&row)?;
        self.rows += 1;
        Ok(())
    }
}

fn is_frame(row: &Row) -> bool {
    matches!(row.own, Some(Own::Raw { .. }))
}

/// Every sensor has given a reading, or there was time for it.
fn settled(rows: &[Row], patience_s: f64) -> bool {
    let (Some(first), Some(end)) = (rows.first(), rows.last()) else { return false };
    let all = rows.iter().any(|row| row.temp_c.is_some())
        && rows.iter().any(|row| row.index_deg.is_finite())
        && rows.iter().any(|row| row.level.is_some())
        && rows.iter().any(|row| row.extra.iter().any(|value| value.is_finite()));
    all || end.t_s - first.t_s >= patience_s
}

/// Takes a row out of the fix.
pub fn unmark(row: &mut Row) {
    if let Some(Own::Second { mark, .. } | Own::Raw { mark, .. }) = &mut row.own {
        *mark = Mark::default();
    }
}

/// Takes the first rows of a file out of the fix. The file is replaced as a whole.
fn clear_marks(path: &Path, rows: usize) -> std::io::Result<()> {
    let mut reader = csv::Reader::from_path(path)?;
    let header = reader.headers()?.clone();
    let marks: Vec<usize> = (0..header.len()).filter(|&column| COMMON[2..].contains(&&header[column])).collect();
    let mut writer = csv::Writer::from_writer(output::replace(path)?);
    writer.write_record(&header)?;
    for (number, record) in reader.records().enumerate() {
        let record = record?;
        let clears = |column: usize| number < rows && marks.contains(&column);
        writer.write_record(record.iter().enumerate().map(|(at, field)| if clears(at) { "0" } else { field }))?;
    }
    writer.into_inner().map_err(|error| error.into_error())?.finish()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn second(t_s: f64, mark: Mark) -> Row {
        let own = Own::Second { read: 0, mark, moment_arcsec_s: 0.0, level_moment: Specific::default() };
        Row { t_s, index_deg: f64::NAN, own: Some(own), ..Row::default() }
    }

    fn column(text: &str, name: &str) -> Vec<String> {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let at = reader.headers().unwrap().iter().position(|each| each == name).unwrap();
        reader.records().map(|record| record.unwrap()[at].to_owned()).collect()
    }

    #[test]
    fn what_was_not_read_repeats_the_last_reading() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut file = RunFile::new(path.clone(), f64::INFINITY, Vec::new());
        let indices = [f64::NAN, 5.0, f64::NAN, 7.0];
        file.push((0..4).map(|t| Row { index_deg: indices[t], ..second(t as f64, Mark::default()) })).unwrap();
        assert_eq!(file.finish().unwrap(), 4);
        assert_eq!(column(&fs::read_to_string(path).unwrap(), "index_deg"), ["5", "5", "5", "7"]);
    }

    /// Without thermometer, encoder and accelerometers the rows wait their time and no longer; each later one is on the disk at once.
    #[test]
    fn rows_are_on_the_disk_when_they_are_pushed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut file = RunFile::new(path.clone(), 2.0, Vec::new());
        for t in 1..=2 {
            file.push([second(f64::from(t), Mark::default())]).unwrap();
            assert!(!path.exists());
        }
        for t in 3..=5 {
            file.push([second(f64::from(t), Mark::default())]).unwrap();
            let times = column(&fs::read_to_string(&path).unwrap(), "t_s");
            assert_eq!(times, (1..=t).map(|t| t.to_string()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn rows_before_the_last_start_are_of_no_dwell() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut file = RunFile::new(path.clone(), 0.0, Vec::new());
        let dwell = |number| Mark { dwell: Some(number), waited_at: None };
        file.push([second(1.0, dwell(0)), second(2.0, dwell(1))]).unwrap();
        file.start_again();
        file.push([second(3.0, Mark::default()), second(4.0, dwell(0))]).unwrap();
        file.finish().unwrap();
        assert_eq!(column(&fs::read_to_string(&path).unwrap(), "dwell"), ["0", "0", "0", "1"]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

//! Records in the project's units and axes, each with its place in time.

use toml::Spanned;

use super::map::{Column, Index, Map};
use super::record::{Losses, Records, field_of};
use super::unit::TimeUnit;
use crate::file_error::{FileError, Place, Problem};

/// No two samples lie further apart, seconds: 1e9 s are 32 years, and a longer gap would be counted in more samples than there can be.
const LONGEST_GAP_S: f64 = 1e9;
/// No value is larger in the project's units: sums of 10⁹ squares are far from the end of the numbers, and a board's single precision holds it.
const LARGEST_VALUE: f64 = 1e30;

/// One sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// End of the sample's interval, seconds from the recording's start.
    pub end_s: f64,
    /// Its length, seconds.
    pub interval_s: f64,
    /// Samples that are missing or not valid between the one before and this one.
    pub lost: u64,
    /// Angle increment, arcsec: of a triad (forward, left, up), of a single gyro (its own, 0, 0).
    pub gyro_arcsec: [f64; 3],
    /// Specific force, g: forward, left, and up if that is measured.
    pub acceleration_g: Option<[f64; 3]>,
    /// Measured index angle, degrees; 0 if the index is virtual.
    pub index_deg: f64,
    pub temp_c: Option<f64>,
    /// In the mapping's order.
    pub channels: Vec<f64>,
}

/// A field of a record, and what its value is to be multiplied by.
#[derive(Clone, Copy, Debug)]
struct Scaled {
    field: usize,
    scale: f64,
}

/// Reads samples from records.
pub struct Sampler<'a> {
    records: Box<dyn Records>,
    map: &'a Map,
    gyro: Vec<Scaled>,
    acceleration: Vec<Scaled>,
    index: Option<usize>,
    temperature: Option<usize>,
    channels: Vec<usize>,
    /// Fields that add up to the time stamp, and their units.
    time: Vec<(usize, TimeUnit)>,
    used: Vec<usize>,
    sample: Sample,
    /// Time stamp that counts as 0, and that of the sample before; only with a time column.
    stamps_s: Option<(f64, f64)>,
    /// Samples that should have come so far, whether they did or not.
    due: u64,
    invalid: u64,
    /// Samples that are missing by the time stamps.
    lost: u64,
    /// Steps from one time stamp to the next that are shorter than half the declared interval.
    short_steps: u64,
    /// The longest step from one time stamp to the next, seconds, and where it ends.
    longest_step: Option<(f64, Place)>,
}

impl<'a> Sampler<'a> {
    /// Finds the mapping's columns in the recording.
    ///
    /// Errors: a column that is not there; a time column in a format that has none.
    pub fn new(records: Box<dyn Records>, map: &'a Map) -> Result<Self, FileError> {
        let field = |column: &Spanned<Column>| field_of(column, records.as_ref(), &map.file);
        let scaled = |columns: &[Spanned<Column>], scale: &[f64]| -> Result<Vec<Scaled>, FileError> {
            columns.iter().zip(scale).map(|(column, &scale)| Ok(Scaled { field: field(column)?, scale })).collect()
        };
        let acceleration = map.accelerometer.as_ref();
        let mut sampler = Self {
            gyro: scaled(&map.gyro.columns, &map.gyro.scale)?,
            acceleration: acceleration.map_or(Ok(Vec::new()), |it| scaled(&it.columns, &it.scale))?,
            index: match &map.index {
                Index::Measured { column, .. } => Some(field(column)?),
                Index::Virtual { .. } | Index::Placed => None,
            },
            temperature: map.temperature.as_ref().map(|it| field(&it.column)).transpose()?,
            channels: map.channels.iter().map(|channel| field(&channel.column)).collect::<Result<_, _>>()?,
            time: map
                .time
                .columns
                .iter()
                .map(|(column, unit)| Ok((field(column)?, *unit)))
                .collect::<Result<_, _>>()?,
            used: Vec::new(),
            sample: Sample::default(),
            stamps_s: None,
            due: 0,
            invalid: 0,
            lost: 0,
            short_steps: 0,
            longest_step: None,
            records,
            map,
        };
        let scaled = sampler.gyro.iter().chain(&sampler.acceleration).map(|it| it.field);
        let others = [sampler.index, sampler.temperature]
            .into_iter()
            .flatten()
            .chain(sampler.time.iter().map(|(field, _)| *field));
        sampler.used = scaled.chain(others).chain(sampler.channels.iter().copied()).collect();
        Ok(sampler)
    }

    /// The next valid sample, or `None` at the recording's end.
    pub fn next_sample(&mut self) -> Result<Option<&Sample>, FileError> {
        let mut lost = 0;
        while let Some(missing) = self.records.advance()? {
            lost += u64::from(missing);
            let Some(by_stamps) = self.place_in_time(missing)? else { continue };
            lost += by_stamps;
            self.lost += by_stamps;
            if self.used.iter().all(|&field| self.records.is_valid(field)) {
                self.sample.lost = lost;
                self.measure()?;
                return Ok(Some(&self.sample));
            }
            self.invalid += 1;
            lost += 1;
        }
        Ok(None)
    }

    /// End of the last sample, seconds from the recording's start.
    pub fn end_s(&self) -> f64 {
        self.sample.end_s
    }

    /// Samples that should have come so far, whether they did or not.
    pub fn due(&self) -> u64 {
        self.due
    }

    /// How far the file has been read, bytes.
    pub fn bytes_read(&self) -> u64 {
        self.records.bytes_read()
    }

    /// Where in the file the last record stands.
    pub fn place(&self) -> Place {
        self.records.error(Problem::NoRows).place
    }

    pub fn losses(&self) -> Losses {
        let losses = self.records.losses();
        Losses {
            lost_samples: losses.lost_samples + self.lost,
            invalid_samples: losses.invalid_samples + self.invalid,
            ..losses
        }
    }

    /// Samples that are missing by the time stamps.
    pub fn lost_by_stamps(&self) -> u64 {
        self.lost
    }

    /// Steps from one time stamp to the next that are shorter than half the declared interval.
    pub fn short_steps(&self) -> u64 {
        self.short_steps
    }

    /// The longest step from one time stamp to the next, seconds, and where it ends.
    pub fn longest_step(&self) -> Option<&(f64, Place)> {
        self.longest_step.as_ref()
    }

    fn note_step(&mut self, step_s: f64) {
        if self.map.time.interval_s.is_some_and(|interval_s| step_s < 0.5 * interval_s) {
            self.short_steps += 1;
        }
        if self.longest_step.as_ref().is_none_or(|(longest_s, _)| step_s > *longest_s) {
            self.longest_step = Some((step_s, self.place()));
        }
    }

    /// Works out when the sample was taken and how many are missing before it by the time stamps; `None` for a first
    /// sample whose interval nothing tells.
    fn place_in_time(&mut self, missing: u32) -> Result<Option<u64>, FileError> {
        let Some(&(field, _)) = self.time.last() else {
            let interval_s = self.map.time.interval_s.unwrap_or_default();
            self.due += u64::from(missing) + 1;
            self.sample.end_s = self.due as f64 * interval_s;
            self.sample.interval_s = interval_s;
            return Ok(Some(0));
        };
        let mut stamp_s = 0.0;
        for &(field, unit) in &self.time {
            stamp_s += match unit {
                TimeUnit::Iso8601 => self.records.moment(field)?,
                unit => self.records.number(field)? * unit.seconds(),
            };
        }
        let (origin_s, previous_s) = match (self.stamps_s, self.map.time.interval_s) {
            (Some(stamps_s), _) => stamps_s,
            (None, Some(interval_s)) => (stamp_s - interval_s, stamp_s - interval_s),
            (None, None) => {
                self.stamps_s = Some((stamp_s, stamp_s));
                return Ok(None);
            }
        };
        let step_s = stamp_s - previous_s;
        if !(step_s > 0.0 && step_s <= LONGEST_GAP_S) {
            let allowed = format!("later than the sample before, {previous_s} s, by at most {LONGEST_GAP_S:e} s");
            return Err(self.records.field_error(field, Problem::not_allowed(format!("{stamp_s:?} s"), allowed)));
        }
        self.note_step(step_s);
        let steps = self.map.time.interval_s.map_or(1.0, |interval_s| (step_s / interval_s).round().max(1.0));
        self.stamps_s = Some((origin_s, stamp_s));
        self.due = self.due.saturating_add(steps as u64);
        self.sample.end_s = stamp_s - origin_s;
        self.sample.interval_s = step_s / steps;
        Ok(Some((steps as u64).saturating_sub(1)))
    }

    fn measure(&mut self) -> Result<(), FileError> {
        let Self { records, map, sample, .. } = self;
        let number = |field: usize, convert: &dyn Fn(f64) -> f64| -> Result<f64, FileError> {
            let written = records.number(field)?;
            let value = convert(written);
            if value.abs() <= LARGEST_VALUE {
                return Ok(value);
            }
            let becomes = format!("{written:?}, which becomes {value:e} with its unit, scale and offset");
            Err(records.field_error(field, Problem::not_allowed(becomes, format!("a value within ±{LARGEST_VALUE:e}"))))
        };
        let mut values = [0.0; 3];
        let mut read = |scaled: &[Scaled], factor: f64| -> Result<[f64; 3], FileError> {
            for (value, column) in values.iter_mut().zip(scaled) {
                *value = number(column.field, &|value| value * column.scale * factor)?;
            }
            Ok(values)
        };
        let gyro = read(&self.gyro, map.gyro.unit.arcsec(sample.interval_s))?;
        sample.gyro_arcsec = match &map.gyro.axes {
            Some(axes) => axes.body(&gyro),
            None => [gyro[0], 0.0, 0.0],
        };
        if let Some(accelerometer) = &map.accelerometer {
            let foreign = read(&self.acceleration, accelerometer.unit.g(sample.interval_s))?;
            sample.acceleration_g = Some(accelerometer.axes.body(&foreign));
        }
        if let (Some(field), Index::Measured { scale, offset_deg, .. }) = (self.index, &map.index) {
            sample.index_deg = number(field, &|value| value * scale + offset_deg)?;
        }
        if let (Some(field), Some(temperature)) = (self.temperature, &map.temperature) {
            let celsius = |value| temperature.unit.celsius(value * temperature.scale + temperature.offset);
            sample.temp_c = Some(number(field, &celsius)?);
        }
        sample.channels.clear();
        for (&field, channel) in self.channels.iter().zip(&map.channels) {
            sample.channels.push(number(field, &|value| value * channel.scale + channel.offset)?);
        }
        Ok(())
    }
}

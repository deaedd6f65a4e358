//! What a recording holds, gathered to seconds: rows of any interval, and frames of the instrument.

use quantities::codes::{IndexCode, TriadCode};

use super::{Mark, RawRow, Recorded, Row};
use crate::effects::{Conditions, MAX_CHANNELS};
use crate::fix::accumulator::Second;
use crate::health::Counters;
use crate::instrument::gather::Gatherer;
use crate::sensing::frame::{Frame, GyroFormat};
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;
use crate::sensing::ripple::Ripple;
use crate::settings::Settings;
use crate::units::{RAD_PER_DEG, sin_cos_deg, wrap_180_deg};

/// The index is at rest while it stays within this, degrees.
pub const REST_DEG: f64 = 0.5;
/// Rows are gathered until they cover this, seconds. (A little less than one, for time stamps that are rounded.)
const GATHER_S: f64 = 0.9995;

/// A second of a recording (or a longer row), before the error model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedSecond {
    pub second: Second,
    pub belonging: Belonging,
}

/// What says to which dwell a second belongs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Belonging {
    /// The instrument recorded it.
    Marked(Mark),
    /// The index angle of a foreign recording: that of the second's first row, degrees, and whether the index moved within it.
    Angle { first_deg: f64, moved: bool },
}

/// Gathers a recording to seconds. The same recording gives the same seconds whatever the error model.
#[derive(Clone, Debug)]
pub struct Seconds {
    rows: RowGatherer,
    readings: Gatherer,
    counters: Counters,
    sequence: u8,
    format: GyroFormat,
}

impl Seconds {
    pub fn new(settings: &Settings) -> Self {
        Self {
            rows: RowGatherer::default(),
            readings: Gatherer::new(settings.gyro, settings.triad()),
            counters: Counters::default(),
            sequence: 0,
            format: settings.gyro.format,
        }
    }

    /// Takes the next of a recording; gives the second that ended before it, and the one that it completes.
    pub fn push(&mut self, recorded: &Recorded) -> [Option<RecordedSecond>; 2] {
        match recorded {
            Recorded::Row(row) => self.rows.push(row),
            Recorded::Second(second, mark) => {
                [None, Some(RecordedSecond { second: *second, belonging: Belonging::Marked(*mark) })]
            }
            Recorded::Raw(row) => [None, self.raw(row)],
        }
    }

    /// Ends the second under way, if it has a row.
    pub fn finish(&mut self) -> Option<RecordedSecond> {
        self.rows.finish()
    }

    /// A frame of the instrument and what was read with it: gathered as the instrument does.
    fn raw(&mut self, row: &RawRow) -> Option<RecordedSecond> {
        if let Some(reading) = row.acceleration_g.and_then(TriadCode::of_g) {
            self.readings.acceleration(reading);
        }
        if let Some(index_deg) = row.index_deg {
            self.readings.index(IndexCode::of_deg(index_deg));
        }
        let rate = match (row.fog_arcsec, row.temp_c) {
            (None, None) => self.readings.lost_frame(&mut self.counters),
            (increment_arcsec, temp_c) => {
                let frame = Frame {
                    sequence: self.sequence,
                    increment: increment_arcsec
                        .map_or(0, |arcsec| counts(arcsec, self.format.arcsec_per_count()) as i64),
                    temperature: temp_c.map(|temp_c| counts(temp_c, self.format.c_per_count()) as i16),
                    valid: increment_arcsec.is_some(),
                    saturated: false,
                };
                self.readings.frame(&frame, &mut self.counters)
            }
        };
        self.sequence = ((u16::from(self.sequence) + 1) % self.format.sequence_modulus()) as u8;
        let mut second = self.readings.finish(&rate?, row.t_s).directed();
        second.conditions.channels = row.channels;
        second.level_temp_c = row.level_temp_c.filter(|_| second.conditions.level.is_some());
        Some(RecordedSecond { second, belonging: Belonging::Marked(row.mark) })
    }
}

/// A quantity in whole numbers of its unit.
fn counts(value: f64, unit: f64) -> f64 {
    libm::round(value / unit)
}

/// Gathers rows to seconds. A row within which the index moved stands alone.
#[derive(Clone, Debug, Default)]
struct RowGatherer {
    last_deg: Option<f64>,
    sums: Sums,
}

/// Sums over the rows of a second, weighted by their time.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    rows: u32,
    seconds: f64,
    end_s: f64,
    index: Direction,
    raw_arcsec: f64,
    /// Angles times their time, and first moments of the rows themselves.
    timed_arcsec_s: f64,
    /// The path of the angle, arcsec by seconds.
    ripple: Ripple,
    level: Specific,
    /// Readings times their time.
    timed_level: Specific,
    level_seconds: f64,
    temp_c: f64,
    temp_seconds: f64,
    level_temp_c: f64,
    level_temp_seconds: f64,
    channels: [f64; MAX_CHANNELS],
    lost_frames: u16,
    first_deg: f64,
    turned_deg: f64,
}

impl RowGatherer {
    /// Takes the next row; gives the second that ended before it, and the one that it completes.
    fn push(&mut self, row: &Row) -> [Option<RecordedSecond>; 2] {
        let way_deg = self.last_deg.replace(row.index_deg).map_or(0.0, |last| wrap_180_deg(row.index_deg - last));
        let moved = way_deg.abs() > REST_DEG;
        let before = if moved { self.finish() } else { None };
        self.sums.push(row, way_deg);
        let complete = moved || self.sums.seconds >= GATHER_S;
        [before, if complete { self.finish() } else { None }]
    }

    fn finish(&mut self) -> Option<RecordedSecond> {
        let sums = core::mem::take(&mut self.sums);
        (sums.seconds > 0.0).then(|| sums.second())
    }
}

impl Sums {
    fn push(&mut self, row: &Row, way_deg: f64) {
        let (sin, cos) = sin_cos_deg(row.index_deg);
        // The mean of a cosine over an arc is shorter than the cosine of its middle.
        let half_rad = 0.5 * way_deg * RAD_PER_DEG;
        let shorter = if half_rad.abs() > 1e-9 { libm::sin(half_rad) / half_rad } else { 1.0 };
        let weight = row.interval_s;
        if self.rows == 0 {
            self.first_deg = row.index_deg;
        }
        // Way within a second, or to a row that stands alone because of it.
        if self.rows > 0 || way_deg.abs() > REST_DEG {
            self.turned_deg += way_deg;
        }
        self.rows += 1;
        self.seconds += weight;
        self.end_s = row.t_s;
        self.index.cos += weight * cos * shorter;
        self.index.sin += weight * sin * shorter;
        self.raw_arcsec += row.fog_arcsec;
        self.ripple.push(self.seconds, self.raw_arcsec);
        self.timed_arcsec_s += row.fog_arcsec * (row.t_s - 0.5 * row.interval_s);
        if let Some(Specific { forward, left }) = row.level {
            let middle_s = row.t_s - 0.5 * weight;
            self.level.forward += weight * forward;
            self.level.left += weight * left;
            self.timed_level.forward += weight * middle_s * forward;
            self.timed_level.left += weight * middle_s * left;
            self.level_seconds += weight;
        }
        if let Some(temp_c) = row.temp_c {
            self.temp_c += weight * temp_c;
            self.temp_seconds += weight;
        }
        if let Some(temp_c) = row.level_temp_c {
            self.level_temp_c += weight * temp_c;
            self.level_temp_seconds += weight;
        }
        for (sum, value) in self.channels.iter_mut().zip(row.channels) {
            *sum += weight * value;
        }
        self.lost_frames = self.lost_frames.saturating_add(row.lost_frames);
    }

    fn second(&self) -> RecordedSecond {
        let t_s = self.end_s - 0.5 * self.seconds;
        let mean = |sum: f64, seconds: f64| (seconds > 0.0).then(|| sum / seconds);
        let level = mean(self.level.forward, self.level_seconds)
            .zip(mean(self.level.left, self.level_seconds))
            .and_then(|(forward, left)| Specific::new(forward, left));
        // As finely as the rows are, like the gyro's, so that what both miss of a base's turning is the same.
        let level_moment = level.map_or(Specific::default(), |mean| Specific {
            forward: self.timed_level.forward - t_s * self.level_seconds * mean.forward,
            left: self.timed_level.left - t_s * self.level_seconds * mean.left,
        });
        RecordedSecond {
            second: Second {
                conditions: Conditions {
                    t_s,
                    seconds: self.seconds,
                    raw_rate_deg_h: self.raw_arcsec / self.seconds,
                    index: Some(Direction { cos: self.index.cos / self.seconds, sin: self.index.sin / self.seconds }),
                    temp_c: mean(self.temp_c, self.temp_seconds),
                    level,
                    channels: self.channels.map(|sum| sum / self.seconds),
                },
                moment_arcsec_s: self.timed_arcsec_s - t_s * self.raw_arcsec,
                ripple_arcsec: self.ripple.rms(),
                level_moment,
                level_temp_c: mean(self.level_temp_c, self.level_temp_seconds).filter(|_| level.is_some()),
                lost_frames: self.lost_frames,
            },
            belonging: Belonging::Angle { first_deg: self.first_deg, moved: self.turned_deg.abs() > REST_DEG },
        }
    }
}

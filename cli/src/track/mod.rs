//! Orientation along a recording of a three-axis block: held ([`held`]) or aided ([`aided`]).

pub mod aided;
pub mod aiding_csv;
pub mod doubt;
pub mod held;
pub mod installation;
pub mod start;

use std::path::Path;

use inertial::{Angles, Motion};
use north_finder::units::wrap_180_deg;

use crate::block_csv::BlockRow;
use crate::file_error::{FileError, Problem};
use crate::table_csv::TableCsv;

/// A second of the track.
#[derive(Clone, Copy, Debug)]
pub struct TrackRow {
    pub t_s: f64,
    pub angles: Angles,
    pub sigma_heading_deg: f64,
    /// Of pitch and roll.
    pub sigma_level_deg: f64,
    /// Heading less its reference, degrees.
    pub error_deg: Option<f64>,
    pub detail: Detail,
}

/// What only one of the two ways knows.
#[derive(Clone, Copy, Debug)]
pub enum Detail {
    Held {
        motion: Motion,
        refix: bool,
    },
    Aided {
        latitude_deg: f64,
        longitude_deg: f64,
        height_m: f64,
        /// East, north, up.
        velocity_m_s: [f64; 3],
        /// East and north together.
        sigma_position_m: f64,
        position_error_m: Option<f64>,
    },
}

/// Innovations of one source: when, squares over their variances, their number; and when readings were rejected.
#[derive(Clone, Debug, Default)]
pub struct Innovations {
    pub name: &'static str,
    pub taken: Vec<(f64, f64, u32)>,
    pub rejected_s: Vec<f64>,
}

/// A track.
#[derive(Clone, Debug)]
pub struct Track {
    pub rows: Vec<TrackRow>,
    pub innovations: Vec<Innovations>,
}

impl Track {
    /// Root mean square error and share of errors within 1.96 sigma, where there is a reference.
    pub fn errors(&self) -> Option<(f64, f64)> {
        let errors: Vec<(f64, f64)> =
            self.rows.iter().filter_map(|row| row.error_deg.map(|error| (error, row.sigma_heading_deg))).collect();
        let n = errors.len() as f64;
        let within = errors.iter().filter(|(error, sigma)| error.abs() <= 1.96 * sigma).count() as f64;
        (n > 0.0).then(|| ((errors.iter().map(|(error, _)| error * error).sum::<f64>() / n).sqrt(), within / n))
    }

    /// Mean normalised squared innovation, and how many.
    pub fn nis(&self) -> (f64, u32) {
        let all = self.innovations.iter().flat_map(|source| &source.taken);
        let (squares, number) = all.fold((0.0, 0), |sum, (_, squares, number)| (sum.0 + squares, sum.1 + number));
        (squares / f64::from(number.max(1)), number)
    }
}

/// Headings to compare with.
#[derive(Clone, Debug, Default)]
pub struct Reference {
    /// Of all rows that have none of their own.
    pub heading_deg: Option<f64>,
    /// Times and headings of another track.
    track: Vec<(f64, f64)>,
}

impl Reference {
    pub fn fixed(heading_deg: Option<f64>) -> Self {
        Self { heading_deg, track: Vec::new() }
    }

    /// A file with `t_s` and `heading_deg`: another track, or what another instrument said.
    ///
    /// Errors: no such file, a column missing or twice, a field that is no number, time that does not increase, no rows.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let mut table = TableCsv::open(path)?;
        let [time, heading] = [table.column("t_s")?, table.column("heading_deg")?];
        let mut track: Vec<(f64, f64)> = Vec::new();
        while table.next_row()? {
            let t_s = table.number(time)?;
            if let Some(&(previous_s, _)) = track.last()
                && t_s <= previous_s
            {
                return Err(table.error(time, Problem::TimeNotIncreasing { t_s, previous_s }));
            }
            track.push((t_s, table.number(heading)?));
        }
        if track.is_empty() {
            return Err(table.whole(Problem::NoRows));
        }
        Ok(Self { heading_deg: None, track })
    }

    /// The first and the last time of the other track, if there is one.
    pub fn span_s(&self) -> Option<[f64; 2]> {
        Some([self.track.first()?.0, self.track.last()?.0])
    }

    /// Heading less what it is compared with: the row's own reference, the other track at that time, the fixed one.
    pub fn error_deg(&self, row: &BlockRow, heading_deg: f64) -> Option<f64> {
        let reference = row.reference_heading_deg.or_else(|| self.at(row.t_s)).or(self.heading_deg)?;
        Some(wrap_180_deg(heading_deg - reference))
    }

    /// Between the neighbours in time; none before the first and after the last.
    fn at(&self, t_s: f64) -> Option<f64> {
        let after = self.track.partition_point(|(other_s, _)| *other_s < t_s);
        let (to_s, to_deg) = *self.track.get(after)?;
        if to_s == t_s {
            return Some(to_deg);
        }
        let (from_s, from_deg) = *self.track.get(after.checked_sub(1)?)?;
        Some(from_deg + wrap_180_deg(to_deg - from_deg) * (t_s - from_s) / (to_s - from_s))
    }
}

//! Recordings of a three-axis block: `t_s, gx_arcsec, gy_arcsec, gz_arcsec, ax_m_s2, ay_m_s2, az_m_s2`.

use std::path::Path;

use inertial::Increment;
use north_finder::units::ARCSEC_PER_RAD;

use crate::file_error::{FileError, Problem};
use crate::table_csv::TableCsv;

/// The columns, in the order of their axes: x forward, y left, z up.
pub const COLUMNS: [&str; 7] = ["t_s", "gx_arcsec", "gy_arcsec", "gz_arcsec", "ax_m_s2", "ay_m_s2", "az_m_s2"];
/// Optional: turn of the block on the hull at the row's end, counter-clockwise from above, degrees.
pub const TURN: &str = "turn_deg";
/// Optional: what to compare with, degrees.
pub const REFERENCES: [&str; 3] = ["reference_heading_deg", "reference_lat_deg", "reference_lon_deg"];

/// The rows of a block lie no further apart, seconds: between them the block turns in a way that they do not tell.
const LONGEST_STEP_S: f64 = 1.0;

/// One row: what the block felt in the interval that ends at `t_s`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockRow {
    pub t_s: f64,
    /// Time since the row before; the first row: since 0, or the median step if it stands at 0.
    pub interval_s: f64,
    pub increment: Increment,
    pub turn_deg: f64,
    pub reference_heading_deg: Option<f64>,
    /// Latitude and longitude.
    pub reference_place_deg: Option<[f64; 2]>,
}

/// A step longer than so many usual ones is a gap.
pub const GAP_STEPS: f64 = 1.5;

impl BlockRow {
    /// How long no rows came before this one, seconds, where the usual step is so long; `None` where none is missing.
    pub fn gap_s(&self, step_s: f64) -> Option<f64> {
        (self.interval_s > GAP_STEPS * step_s).then_some(self.interval_s - step_s)
    }
}

/// A recording and the usual time between its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockRecording {
    pub rows: Vec<BlockRow>,
    pub step_s: f64,
}

/// Reads a recording. Errors: no such file, a column missing or twice, a field that is no number, time that does not increase, rows too far apart, no rows.
pub fn read(path: &Path) -> Result<BlockRecording, FileError> {
    let mut table = TableCsv::open(path)?;
    let mut places = [0; COLUMNS.len()];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = table.column(name)?;
    }
    let (turn, heading) = (table.find_one(TURN)?, table.find_one(REFERENCES[0])?);
    let (latitude, longitude) = (table.find_one(REFERENCES[1])?, table.find_one(REFERENCES[2])?);
    let mut rows: Vec<BlockRow> = Vec::new();
    while table.next_row()? {
        let mut numbers = [0.0; COLUMNS.len()];
        for (value, column) in numbers.iter_mut().zip(places) {
            *value = table.number(column)?;
        }
        let [t_s, gx, gy, gz, ax, ay, az] = numbers;
        if let Some(previous) = rows.last()
            && t_s <= previous.t_s
        {
            let problem = Problem::TimeNotIncreasing { t_s, previous_s: previous.t_s };
            return Err(table.error(places[0], problem));
        }
        let optional = |column: Option<usize>| column.map(|column| table.number(column)).transpose();
        rows.push(BlockRow {
            t_s,
            interval_s: 0.0,
            // Force, until its interval is known.
            increment: Increment {
                angle_rad: [gx, gy, gz].map(|arcsec| arcsec / ARCSEC_PER_RAD).into(),
                velocity_m_s: [ax, ay, az].into(),
            },
            turn_deg: optional(turn)?.unwrap_or_default(),
            reference_heading_deg: optional(heading)?,
            reference_place_deg: optional(latitude)?.zip(optional(longitude)?).map(|(a, b)| [a, b]),
        });
    }
    let mut steps: Vec<f64> = rows.windows(2).map(|pair| pair[1].t_s - pair[0].t_s).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let step_s = *steps.get(steps.len() / 2).ok_or_else(|| table.whole(Problem::NoRows))?;
    if step_s > LONGEST_STEP_S {
        let allowed = format!("at most {LONGEST_STEP_S} s: `t_s` is in seconds, and these may be milliseconds");
        return Err(table.whole(Problem::not_allowed(format!("rows {step_s} s apart"), allowed)));
    }
    // A recording that was cut out of a longer one begins a usual step before its first row.
    let begins = 0.0 < rows[0].t_s && rows[0].t_s <= GAP_STEPS * step_s;
    let mut previous_s = if begins { 0.0 } else { rows[0].t_s - step_s };
    for row in &mut rows {
        row.interval_s = row.t_s - std::mem::replace(&mut previous_s, row.t_s);
        row.increment.velocity_m_s *= row.interval_s;
    }
    Ok(BlockRecording { rows, step_s })
}

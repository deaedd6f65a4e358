//! One recorded run to its azimuth, by the firmware's own replay.

use std::path::Path;

use north_finder::effects::{ChannelName, MAX_CHANNELS};
use north_finder::event::{Dwell, Event, Fix};
use north_finder::fix::dwell::DwellSummary;
use north_finder::replay::{Refusal, Replay, Row as ReplayRow};
use north_finder::settings::Settings;

use crate::campaign::{Row, RunReader};
use crate::file_error::FileError;

/// Stays, or seconds of a continuous rotation, that there is room for at first; more room is made as needed.
const FIRST_SLOTS: usize = 4096;

/// What a run says.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    pub fix: Fix,
    pub dwells: Vec<Dwell>,
}

/// Why a run gives no azimuth.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: {refusal}")]
    Refused { file: String, refusal: Refusal },
    #[error("{file}: the error model follows channel `{channel}`, and the recording has no such column")]
    NoChannel { file: String, channel: String },
}

/// Solves a run that is read row by row; its length is limited by the disk only.
///
/// Errors: the file cannot be read or is wrong somewhere; the settings allow no fix; the rows determine no azimuth.
pub fn solve_file(path: &Path, settings: &Settings) -> Result<Solution, SolveError> {
    let refused = |refusal| SolveError::Refused { file: path.display().to_string(), refusal };
    let mut slots = FIRST_SLOTS;
    loop {
        let reader = RunReader::open(path)?;
        let columns = model_columns(path, &reader, settings)?;
        let rows = reader.map(|row| row.map_err(SolveError::from));
        match solve(rows, &columns, settings, slots, refused) {
            // A continuous rotation over hours: once more from the start, with more room.
            Err(SolveError::Refused { refusal: Refusal::Full, .. }) => slots *= 8,
            solved => return solved,
        }
    }
}

fn solve(
    rows: impl Iterator<Item = Result<Row, SolveError>>,
    columns: &[usize],
    settings: &Settings,
    slots: usize,
    refused: impl Fn(Refusal) -> SolveError,
) -> Result<Solution, SolveError> {
    let mut slots = vec![DwellSummary::default(); slots];
    let mut dwells = Vec::new();
    let mut replay = Replay::new(settings, &mut slots).map_err(&refused)?;
    let mut note = |report: north_finder::event::Report| {
        if let Event::Dwell(dwell) = report.event {
            dwells.push(dwell);
        }
    };
    for row in rows {
        let row = row?;
        let mut channels = [f64::NAN; MAX_CHANNELS];
        for (value, &column) in channels.iter_mut().zip(columns) {
            *value = row.extra.get(column).copied().unwrap_or(f64::NAN);
        }
        replay.push_with_channels(&replay_row(&row), channels, &mut note).map_err(&refused)?;
    }
    let fix = replay.finish(&mut note).map_err(&refused)?;
    Ok(Solution { fix, dwells })
}

/// Which of the reader's extra channels the model follows, in the model's order.
///
/// Errors: the recording lacks one, or the temperature or the level that a term needs.
fn model_columns(path: &Path, reader: &RunReader, settings: &Settings) -> Result<Vec<usize>, SolveError> {
    let Some(model) = &settings.model else { return Ok(Vec::new()) };
    let missing = |channel: &str| SolveError::NoChannel { file: path.display().to_string(), channel: channel.into() };
    if let Some(lacking) = model.lacks(reader.has_temperature(), reader.has_level()) {
        return Err(missing(lacking));
    }
    let column = |name: &ChannelName| {
        reader.channels().iter().position(|each| each == name.as_str()).ok_or_else(|| missing(name.as_str()))
    };
    model.channels().iter().map(column).collect()
}

/// A row as the replay takes it.
pub fn replay_row(row: &Row) -> ReplayRow {
    ReplayRow {
        t_s: row.t_s,
        interval_s: row.interval_s,
        index_deg: row.index_deg,
        fog_arcsec: row.fog_arcsec,
        temp_c: row.temp_c,
        level_g: row.level_g,
        lost_frames: row.lost_frames,
    }
}

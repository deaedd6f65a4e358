//! One recorded run to its azimuth, by the firmware's own replay.

use std::path::Path;

use north_finder::azimuth::dwell::DwellSummary;
use north_finder::event::{Dwell, Event, Fix};
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
}

/// Solves a run that is read row by row; its length is limited by the disk only.
///
/// Errors: the file cannot be read or is wrong somewhere; the settings allow no fix; the rows determine no azimuth.
pub fn solve_file(path: &Path, settings: &Settings) -> Result<Solution, SolveError> {
    let refused = |refusal| SolveError::Refused { file: path.display().to_string(), refusal };
    let mut slots = FIRST_SLOTS;
    loop {
        let rows = RunReader::open(path)?.map(|row| row.map_err(SolveError::from));
        match solve(rows, settings, slots, refused) {
            // A continuous rotation over hours: once more from the start, with more room.
            Err(SolveError::Refused { refusal: Refusal::Full, .. }) => slots *= 8,
            solved => return solved,
        }
    }
}

fn solve(
    rows: impl Iterator<Item = Result<Row, SolveError>>,
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
        replay.push(&replay_row(&row?), &mut note).map_err(&refused)?;
    }
    let fix = replay.finish(&mut note).map_err(&refused)?;
    Ok(Solution { fix, dwells })
}

fn replay_row(row: &Row) -> ReplayRow {
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

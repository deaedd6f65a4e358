//! One recorded run to its azimuth, by the firmware's own accumulator.

use std::path::Path;

use calibration::ellipsoid::Correction;
use north_finder::effects::now::RunFacts;
use north_finder::effects::{ChannelName, Conditions, ErrorModel, HOUR_OF_DAY, MAX_CHANNELS};
use north_finder::event::{Dwell, Fix};
use north_finder::fix::accumulator::{Corrected, Dwells, Second};
use north_finder::fix::dwell::DwellSummary;
use north_finder::instrument::replay::{RawRow, Recorded, Refusal, Replay, Reported, Row as ReplayRow, Waiting};
use north_finder::sensing::index::Direction;
use north_finder::sensing::level::Specific;
use north_finder::settings::Settings;

use crate::campaign::{ACCELEROMETERS, INDEX, Own, Row, RunReader, TEMPERATURE};
use crate::file_error::FileError;

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
    #[error("{file}: the error model follows the {fact}, and the campaign does not say when the run `started`")]
    NotStarted { file: String, fact: &'static str },
}

/// A replay's dwells where there is always room.
#[derive(Clone, Debug, Default)]
pub struct AllDwells(Vec<DwellSummary>);

impl Dwells for AllDwells {
    fn push(&mut self, dwell: DwellSummary) -> bool {
        self.0.push(dwell);
        true
    }

    fn as_slice(&self) -> &[DwellSummary] {
        &self.0
    }

    fn get_mut(&mut self, number: usize) -> Option<&mut DwellSummary> {
        self.0.get_mut(number)
    }

    fn retain(&mut self, keep: impl FnMut(&DwellSummary) -> bool) {
        self.0.retain(keep);
    }
}

/// A replay's seconds that wait.
#[derive(Clone, Debug, Default)]
pub struct AllSeconds(Vec<Corrected>);

impl Waiting for AllSeconds {
    fn push(&mut self, second: Corrected) {
        self.0.push(second);
    }

    fn as_slice(&self) -> &[Corrected] {
        &self.0
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

/// Solves a run that is read row by row; its length is limited by the disk only. `run`: what the campaign says of it as a whole.
///
/// Errors: the model needs more of that; the file cannot be read or is wrong somewhere; the settings allow no fix; the rows determine no azimuth.
pub fn solve_file(path: &Path, settings: &Settings, run: RunFacts) -> Result<Solution, SolveError> {
    if let Some(fact) = settings.model.as_ref().and_then(|model| lacking_fact(model, &run)) {
        return Err(SolveError::NotStarted { file: path.display().to_string(), fact });
    }
    let refused = |refusal| SolveError::Refused { file: path.display().to_string(), refusal };
    let reader = RunReader::open(path)?;
    let columns = model_columns(path, &reader, settings)?;
    let mut dwells = Vec::new();
    let mut note = |told: Reported| {
        if let Reported::Dwell { dwell, .. } = told {
            dwells.push(dwell);
        }
    };
    let mut replay = Replay::new(settings, AllDwells::default(), AllSeconds::default()).map_err(refused)?;
    replay.set_run(run);
    let triad = settings.triad();
    for row in reader {
        let mut row = row?;
        correct_level(&mut row, &triad);
        let mut channels = [f64::NAN; MAX_CHANNELS];
        for (value, &column) in channels.iter_mut().zip(&columns) {
            *value = row.extra.get(column).copied().unwrap_or(f64::NAN);
        }
        replay.push(&recorded(&row, channels), &mut note);
    }
    let fix = replay.finish(&mut note).map_err(refused)?;
    Ok(Solution { fix, dwells })
}

/// What a model follows of a run as a whole and nothing is known of.
pub fn lacking_fact(model: &ErrorModel, run: &RunFacts) -> Option<&'static str> {
    model.facts_of_runs().find(|fact| match *fact {
        HOUR_OF_DAY => run.hour_of_day.is_none(),
        _ => run.rest_s.is_none(),
    })
}

/// Solves rows that are there already.
pub fn solve_rows(settings: &Settings, rows: impl IntoIterator<Item = Recorded>) -> Result<Fix, Refusal> {
    let mut replay = Replay::new(settings, AllDwells::default(), AllSeconds::default())?;
    rows.into_iter().for_each(|row| replay.push(&row, &mut |_| ()));
    replay.finish(&mut |_| ())
}

/// Solves the seconds of a fix that is still under way.
pub fn solve_seconds(settings: &Settings, rows: &[Row]) -> Result<Fix, Refusal> {
    solve_rows(settings, rows.iter().map(|row| recorded(row, [f64::NAN; MAX_CHANNELS])))
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

/// A row as the replay takes it; the channels in the order of the model.
pub fn recorded(row: &Row, channels: [f64; MAX_CHANNELS]) -> Recorded {
    let level = row.level.and_then(|Specific { forward, left }| Specific::new(forward, left));
    match row.own {
        None => Recorded::Row(ReplayRow {
            t_s: row.t_s,
            interval_s: row.interval_s,
            index_deg: row.index_deg,
            fog_arcsec: row.fog_arcsec,
            temp_c: row.temp_c,
            level,
            level_temp_c: row.level_temp_c,
            lost_frames: row.lost_frames,
            channels,
        }),
        Some(Own::Second { read, mark, moment_arcsec_s, level_moment }) => {
            let conditions = Conditions {
                t_s: row.t_s - 0.5,
                raw_rate_deg_h: row.fog_arcsec,
                index: (read & INDEX != 0).then(|| Direction::of_deg(row.index_deg)),
                temp_c: row.temp_c.filter(|_| read & TEMPERATURE != 0),
                level: level.filter(|_| read & ACCELEROMETERS != 0),
                channels,
                ..Conditions::default()
            };
            let level_temp_c = row.level_temp_c.filter(|_| conditions.level.is_some());
            let lost_frames = row.lost_frames;
            let second =
                Second { conditions, moment_arcsec_s, level_moment, level_temp_c, lost_frames, ..Second::default() };
            Recorded::Second(second, mark)
        }
        Some(Own::Raw { read, mark, az_g }) => Recorded::Raw(RawRow {
            t_s: row.t_s,
            fog_arcsec: (row.lost_frames == 0).then_some(row.fog_arcsec),
            temp_c: row.temp_c.filter(|_| read & TEMPERATURE != 0),
            acceleration_g: row
                .level
                .filter(|_| read & ACCELEROMETERS != 0)
                .map(|level| [level.forward, level.left, az_g]),
            index_deg: (read & INDEX != 0).then_some(row.index_deg),
            level_temp_c: row.level_temp_c,
            channels,
            mark,
        }),
    }
}

/// Corrects the level accelerometers of a plain row; an instrument's own seconds are corrected already, and its frames are by
/// the replay. The third accelerometer, which is not recorded, reads what gravity leaves for it.
pub fn correct_level(row: &mut Row, triad: &Correction) {
    let plain = row.own.is_none() && *triad != Correction::UNIT;
    let Some(Specific { forward: x, left: y }) = row.level.filter(|_| plain) else { return };
    let [[m11, m12, m13], [m21, m22, m23], [_, _, m33]] = triad.matrix;
    let [bx, by, _] = triad.bias;
    let (x, y) = (x - bx, y - by);
    // z less its bias is 1/m33 of its force, to the first order in the misalignments.
    let z = (1.0 - x * x - y * y).max(0.0).sqrt() / m33;
    row.level = Some(Specific { forward: m11 * x + m12 * y + m13 * z, left: m21 * x + m22 * y + m23 * z });
}

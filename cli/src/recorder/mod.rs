//! A fix as a run of a campaign: what `north solve` reads again, and solves to the same azimuth.

mod raw;

pub use raw::RawRecorder;

use std::path::Path;

use north_finder::attitude::Motion;
use north_finder::effects::channel::BLOCK_TEMPERATURE;
use north_finder::event::{Event, Heading, Report, Second, State};
use north_finder::level::Specific;
use north_finder::replay::Mark;
use north_finder::settings::Settings;

use crate::campaign::{
    ACCELEROMETERS, Campaign, CampaignWriter, INDEX, Instrument, Layout, Own, OwnLayout, Row, TEMPERATURE,
};
use crate::engine::Setup;
use crate::file_error::FileError;

/// Collects the seconds of one fix, those while the index turns as well.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    rows: Vec<Row>,
}

impl Recorder {
    /// Takes a report; all but seconds and the start of a fix are ignored.
    pub fn see(&mut self, report: &Report) {
        match &report.event {
            Event::Second(second) => self.rows.push(row(second)),
            Event::State(State::Levelling) => start_again(&mut self.rows),
            _ => {}
        }
    }

    /// The rows, one second each.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The rows, the recorder done.
    pub fn into_rows(self) -> Vec<Row> {
        self.rows
    }
}

/// A recording holds one fix, the last that was started: what came before is only the error model's past.
fn start_again(rows: &mut [Row]) {
    for row in rows {
        if let Some(Own::Second { mark, .. } | Own::Raw { mark, .. }) = &mut row.own {
            *mark = Mark::default();
        }
    }
}

fn mark(second: &Second) -> Mark {
    Mark { dwell: second.dwell, waited_at: second.waited_at }
}

fn row(second: &Second) -> Row {
    let read = u8::from(second.temp_c.is_some()) * TEMPERATURE
        + u8::from(second.level.is_some()) * ACCELEROMETERS
        + u8::from(second.index_deg.is_some()) * INDEX;
    let level_moment = second.level.map_or(Specific::default(), |level| level.first);
    Row {
        t_s: second.t_s,
        interval_s: 1.0,
        index_deg: second.index_deg.unwrap_or(f64::NAN),
        fog_arcsec: second.fog_arcsec,
        temp_c: second.temp_c,
        level: second.level.map(|level| level.mean),
        lost_frames: second.lost_frames,
        own: Some(Own::Second { read, mark: mark(second), moment_arcsec_s: second.moment_arcsec_s, level_moment }),
        extra: second.block_temp_c.into_iter().collect(),
    }
}

/// Where a sensor was not read, its last reading is repeated, or the first one before that: the format has no empty fields.
fn fill<T: Copy>(rows: &mut [Row], get: impl Fn(&Row) -> Option<T>, set: impl Fn(&mut Row, T)) {
    let Some(mut last) = rows.iter().find_map(&get) else { return };
    for row in rows {
        last = get(row).unwrap_or(last);
        set(row, last);
    }
}

/// Writes rows as a run's file.
pub fn write_run(campaign: &CampaignWriter, file: &str, mut rows: Vec<Row>) -> Result<(), FileError> {
    fill(&mut rows, |row| row.temp_c, |row, temp_c| row.temp_c = Some(temp_c));
    fill(&mut rows, |row| Some(row.index_deg).filter(|deg| deg.is_finite()), |row, deg| row.index_deg = deg);
    fill(&mut rows, |row| row.level, |row, level| row.level = Some(level));
    fill(&mut rows, |row| row.extra.first().copied(), |row, block_temp_c| row.extra = vec![block_temp_c]);
    let has_block = rows.iter().all(|row| !row.extra.is_empty());
    for row in &mut rows {
        // Sensors that never gave anything.
        row.level.get_or_insert_default();
        if !row.index_deg.is_finite() {
            row.index_deg = 0.0;
        }
    }
    let frames = rows.iter().any(|row| matches!(row.own, Some(Own::Raw { .. })));
    let layout = Layout {
        temperature: rows.iter().all(|row| row.temp_c.is_some()),
        level: true,
        lost_frames: true,
        own: Some(if frames { OwnLayout::Frames } else { OwnLayout::Seconds }),
        extra: if has_block { vec![BLOCK_TEMPERATURE.into()] } else { Vec::new() },
    };
    let mut writer = campaign.run(file, layout)?;
    rows.iter().try_for_each(|row| writer.write(row))?;
    writer.finish()
}

/// Writes headings that were held, with their times, s, in the columns of `north track`.
pub fn write_headings(path: &Path, headings: &[(f64, Heading)]) -> Result<(), FileError> {
    let mut text =
        String::from("t_s,heading_deg,pitch_deg,roll_deg,sigma_heading_deg,sigma_level_deg,standing,refix\n");
    for (t_s, heading) in headings {
        let Heading { heading_deg, pitch_deg, roll_deg, sigma_deg, sigma_level_deg, motion, refix } = heading;
        let standing = u8::from(*motion == Motion::Standing);
        text += &format!(
            "{t_s},{heading_deg},{pitch_deg},{roll_deg},{sigma_deg},{sigma_level_deg},{standing},{}\n",
            u8::from(*refix)
        );
    }
    std::fs::write(path, text).map_err(|error| FileError::whole(path, error))
}

/// A new campaign of simulated runs, in a folder that must be free, with the settings of the instrument.
pub fn new_campaign(folder: &Path, title: String, setup: &Setup) -> Result<CampaignWriter, FileError> {
    let default = Settings { latitude_deg: setup.scenario.site.latitude_deg, ..Settings::default() };
    campaign(folder, Some(title), "simulated".into(), setup.settings.as_ref().unwrap_or(&default))
}

/// A new campaign of a board, the same.
pub fn board_campaign(folder: &Path, name: String, settings: &Settings) -> Result<CampaignWriter, FileError> {
    campaign(folder, None, name, settings)
}

fn campaign(
    folder: &Path,
    title: Option<String>,
    name: String,
    settings: &Settings,
) -> Result<CampaignWriter, FileError> {
    let file = "settings.toml";
    let instrument = Instrument {
        name: Some(name),
        arw_deg_per_sqrt_h: Some(settings.gyro.arw_deg_per_sqrt_h),
        settings: Some(file.into()),
    };
    let writer = CampaignWriter::create(Campaign {
        folder: folder.to_owned(),
        title,
        latitude_deg: Some(settings.latitude_deg),
        instrument: Some(instrument),
        runs: Vec::new(),
    })?;
    crate::settings_file::write_settings(&folder.join(file), settings)?;
    Ok(writer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_read_repeats_the_last_reading() {
        let index = |index_deg: f64| Row { index_deg, ..Row::default() };
        let mut rows = [index(f64::NAN), index(5.0), index(f64::NAN), index(7.0)];
        fill(&mut rows, |row| Some(row.index_deg).filter(|deg| deg.is_finite()), |row, deg| row.index_deg = deg);
        assert_eq!(rows.map(|row| row.index_deg), [5.0, 5.0, 5.0, 7.0]);
    }
}

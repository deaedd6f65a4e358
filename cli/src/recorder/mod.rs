//! A fix as a run of a campaign: what `north solve` reads again, and solves to the same azimuth.

mod raw;
mod run_file;

pub use raw::RawRecorder;
pub use run_file::RunFile;

use std::mem;
use std::path::Path;

use inertial::Motion;
use north_finder::effects::channel::BLOCK_TEMPERATURE;
use north_finder::event::{Event, Heading, Report, Second, State};
use north_finder::instrument::replay::Mark;
use north_finder::sensing::level::Specific;
use north_finder::settings::Settings;

use crate::campaign::{ACCELEROMETERS, Campaign, CampaignWriter, INDEX, Instrument, Own, Row, SETTINGS, TEMPERATURE};
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

    /// The rows, which the recorder then no longer has.
    pub fn take_rows(&mut self) -> Vec<Row> {
        mem::take(&mut self.rows)
    }
}

/// A recording holds one fix, the last that was started: what came before is only the error model's past.
fn start_again(rows: &mut [Row]) {
    rows.iter_mut().for_each(run_file::unmark);
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
        level_temp_c: second.level_temp_c,
        lost_frames: second.lost_frames,
        own: Some(Own::Second { read, mark: mark(second), moment_arcsec_s: second.moment_arcsec_s, level_moment }),
        extra: extra(second),
    }
}

/// The channels beyond those of every second, in the order of [`extra_names`]; not-a-number where one has no reading.
fn extra(second: &Second) -> Vec<f64> {
    let auxiliary = second.auxiliary.iter().map(|value| value.map_or(f64::NAN, f64::from));
    std::iter::once(second.block_temp_c.unwrap_or(f64::NAN)).chain(auxiliary).collect()
}

/// Their names; empty for an input that has none, which reads nothing.
pub fn extra_names(settings: &Settings) -> Vec<String> {
    let auxiliary = settings.analogue.names();
    let names = auxiliary.iter().map(|name| name.as_ref().map_or_else(String::new, |name| name.as_str().to_owned()));
    std::iter::once(BLOCK_TEMPERATURE.to_owned()).chain(names).collect()
}

/// Writes rows as a run's file.
pub fn write_run(campaign: &CampaignWriter, file: &str, rows: Vec<Row>) -> Result<(), FileError> {
    let mut run = RunFile::new(campaign.path_of(file), f64::INFINITY, campaign.extra_names().to_vec());
    run.push(rows)?;
    run.finish().map(|_| ())
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
    crate::output::write(path, text).map_err(|error| FileError::whole(path, error))
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
    let instrument = Instrument {
        name: Some(name),
        arw_deg_per_sqrt_h: Some(settings.gyro.arw_deg_per_sqrt_h),
        settings: Some(SETTINGS.into()),
    };
    let mut writer = CampaignWriter::create(Campaign {
        folder: folder.to_owned(),
        title,
        latitude_deg: Some(settings.latitude_deg),
        instrument: Some(instrument),
        runs: Vec::new(),
    })?;
    crate::settings_file::write_settings(&folder.join(SETTINGS), settings)?;
    writer.name_extra(extra_names(settings));
    Ok(writer)
}

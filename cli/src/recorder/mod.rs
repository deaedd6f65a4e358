//! A fix as a run of a campaign: what `north solve` reads again.

mod raw;

pub use raw::RawRecorder;

use std::path::Path;

use north_finder::event::{Event, Report, Second};

use crate::campaign::{Campaign, CampaignWriter, Instrument, Layout, Row};
use crate::engine::Setup;
use crate::file_error::FileError;

/// Collects the seconds of one fix, those while the index turns as well.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    rows: Vec<Row>,
    /// Time of the reports' clock at which the recording begins.
    start_s: f64,
    /// A second without a reading of the index, to become part of the next row.
    held: Option<Row>,
}

impl Recorder {
    /// Takes a report; all but seconds are ignored.
    pub fn see(&mut self, report: &Report) {
        if let Event::Second(second) = &report.event {
            self.second(report.t_s, second);
        }
    }

    /// The rows, one second each but where a reading of the index was missing.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The rows, the recorder done.
    pub fn into_rows(self) -> Vec<Row> {
        self.rows
    }

    /// The gyro's seconds follow each other without a gap, each exactly 400 samples long; the reports of them come at
    /// whole ticks, a little early or late. So the times in the recording are whole seconds.
    fn second(&mut self, t_s: f64, second: &Second) {
        let previous_s = self.held.as_ref().or(self.rows.last()).map(|row| row.t_s);
        let t_s = match previous_s {
            None => {
                self.start_s = t_s - 1.0;
                1.0
            }
            Some(previous_s) => (t_s - self.start_s).round().max(previous_s + 1.0),
        };
        let mut row = Row {
            t_s,
            interval_s: t_s - previous_s.unwrap_or(0.0),
            index_deg: second.index_deg.unwrap_or_default(),
            fog_arcsec: second.fog_arcsec,
            temp_c: second.temp_c,
            level_g: second.level_g,
            lost_frames: second.lost_frames,
            extra: Vec::new(),
        };
        if let Some(held) = self.held.take() {
            row.interval_s += held.interval_s;
            row.fog_arcsec += held.fog_arcsec;
            row.lost_frames = row.lost_frames.saturating_add(held.lost_frames);
        }
        if second.index_deg.is_some() {
            self.rows.push(row);
        } else {
            self.held = Some(row);
        }
    }
}

/// Writes rows as a run's file.
///
/// A column that not every row can fill is not written: the format has no empty fields.
pub fn write_run(campaign: &CampaignWriter, file: &str, rows: &[Row]) -> Result<(), FileError> {
    let layout = Layout {
        temperature: rows.iter().all(|row| row.temp_c.is_some()),
        level: rows.iter().all(|row| row.level_g.is_some()),
        lost_frames: true,
        extra: Vec::new(),
    };
    let mut writer = campaign.run(file, layout)?;
    rows.iter().try_for_each(|row| writer.write(row))?;
    writer.finish()
}

/// A new campaign of simulated runs, in a folder that must be free.
pub fn new_campaign(folder: &Path, title: String, setup: &Setup) -> Result<CampaignWriter, FileError> {
    let settings = setup.settings.as_ref();
    let arw_deg_per_sqrt_h = settings.map(|settings| settings.gyro.arw_deg_per_sqrt_h);
    // What the instrument was told: a replay must meet the same.
    let latitude_deg = settings.map_or(setup.scenario.site.latitude_deg, |settings| settings.latitude_deg);
    CampaignWriter::create(Campaign {
        folder: folder.to_owned(),
        title: Some(title),
        latitude_deg: Some(latitude_deg),
        instrument: Some(Instrument { name: Some("simulated".into()), arw_deg_per_sqrt_h }),
        runs: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(t_s: f64, index_deg: Option<f64>, fog_arcsec: f64) -> Report {
        let second = Second {
            index_deg,
            fog_arcsec,
            rate_deg_h: fog_arcsec,
            temp_c: None,
            level_g: None,
            lost_frames: 1,
            position: None,
            collected: false,
        };
        Report { t_s, event: Event::Second(second) }
    }

    fn rows(reports: &[Report]) -> Vec<(f64, f64, f64, u16)> {
        let mut recorder = Recorder::default();
        reports.iter().for_each(|report| recorder.see(report));
        recorder.rows().iter().map(|row| (row.t_s, row.interval_s, row.fog_arcsec, row.lost_frames)).collect()
    }

    #[test]
    fn times_are_whole_seconds_from_the_first_one_on() {
        // A gyro that took 0.3 s to start, and reports that come a tick late or early.
        let reports = [report(1.3, Some(0.0), 9.0), report(2.303, Some(0.0), 8.0), report(3.2975, Some(0.0), 7.0)];
        assert_eq!(rows(&reports), [(1.0, 1.0, 9.0, 1), (2.0, 1.0, 8.0, 1), (3.0, 1.0, 7.0, 1)]);
    }

    #[test]
    fn a_second_without_an_index_becomes_part_of_the_next() {
        let reports = [report(1.0, Some(0.0), 9.0), report(2.0, None, 8.0), report(3.0, Some(0.0), 7.0)];
        assert_eq!(rows(&reports), [(1.0, 1.0, 9.0, 1), (3.0, 2.0, 15.0, 2)]);
    }
}

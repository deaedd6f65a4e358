//! A composed campaign as files, and its truth beside them.

use std::path::Path;

use north::campaign::{self, CampaignWriter, Instrument, Layout, Role};
use north::failure::Failure;
use north_finder::sensing::level::Specific;
use serde::{Deserialize, Serialize};

use super::{Campaign, Kind, Row};

/// What `truth.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    pub kind: Kind,
    pub effects: usize,
    /// Port, shapes, dynamics and signals of each effect.
    pub names: Vec<String>,
    /// Ports of the effects.
    pub ports: Vec<String>,
    /// What is hidden, with its constants.
    pub composition: Vec<String>,
    /// Draws until one counted.
    pub draws: u64,
    pub before_rms_deg: f64,
    pub oracle_rms_deg: f64,
    pub runs: Vec<RunTruth>,
}

/// One run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunTruth {
    pub file: String,
    /// "fit" or "check".
    pub role: String,
    pub true_azimuth_deg: f64,
    pub plain_azimuth_deg: f64,
    /// Of check runs.
    pub oracle_azimuth_deg: Option<f64>,
    pub oracle_sigma_deg: Option<f64>,
}

impl Campaign {
    /// The truth.
    pub fn truth(&self) -> Truth {
        let run = |number: usize| {
            let plan = &self.plan.runs[number];
            RunTruth {
                file: file_name(number),
                role: if plan.is_fit { "fit" } else { "check" }.to_owned(),
                true_azimuth_deg: plan.azimuth_deg,
                plain_azimuth_deg: self.plain_deg[number],
                oracle_azimuth_deg: self.oracle[number].map(|told| told.azimuth_deg),
                oracle_sigma_deg: self.oracle[number].map(|told| told.sigma_deg),
            }
        };
        Truth {
            kind: self.kind,
            effects: self.effects.len(),
            names: self.effects.iter().map(super::Effect::name).collect(),
            ports: self.effects.iter().map(|effect| effect.port.name().to_owned()).collect(),
            composition: self.describe(),
            draws: self.draws,
            before_rms_deg: self.before_deg(),
            oracle_rms_deg: self.oracle_deg(),
            runs: (0..self.rows.len()).map(run).collect(),
        }
    }

    /// Writes the campaign and `truth.json` into a new or empty folder.
    pub fn write(&self, folder: &Path) -> Result<(), Failure> {
        let mut writer = CampaignWriter::create(campaign::Campaign {
            folder: folder.to_owned(),
            title: Some("composed at random".into()),
            latitude_deg: Some(self.plan.latitude_deg),
            instrument: Some(Instrument {
                name: Some("simulated".into()),
                arw_deg_per_sqrt_h: Some(self.plan.arw_deg_per_sqrt_h),
                settings: None,
            }),
            runs: Vec::new(),
        })?;
        for (number, rows) in self.rows.iter().enumerate() {
            let plan = &self.plan.runs[number];
            let file = file_name(number);
            self.write_run(rows, &writer, &file)?;
            writer.add(campaign::Run {
                file,
                role: if plan.is_fit { Role::Fit } else { Role::Check },
                reference_azimuth_deg: plan.reference_deg.map(|(reference_deg, _)| reference_deg),
                reference_sigma_deg: plan.reference_deg.map(|(_, sigma_deg)| sigma_deg),
                started: self.plan.has_started.then(|| rfc_3339(plan.started_s)),
                ..campaign::Run::default()
            });
        }
        writer.finish()?;
        let text = serde_json::to_string_pretty(&self.truth()).map_err(std::io::Error::other)?;
        Ok(std::fs::write(folder.join("truth.json"), text)?)
    }

    fn write_run(&self, rows: &[Row], campaign: &CampaignWriter, file: &str) -> Result<(), Failure> {
        let first_extra = usize::from(self.plan.has_temperature);
        let has_level = self.plan.level_noise_g.is_some();
        let layout = Layout {
            temperature: self.plan.has_temperature,
            level: has_level,
            level_temperature: false,
            lost_frames: false,
            own: None,
            extra: self.plan.channels.iter().skip(first_extra).map(|channel| channel.name.clone()).collect(),
        };
        let mut writer = campaign.run(file, layout)?;
        for row in rows {
            writer.write(&campaign::Row {
                t_s: row.t_s,
                interval_s: 1.0,
                index_deg: row.index_deg,
                fog_arcsec: row.fog_arcsec,
                temp_c: row.channels.first().copied().filter(|_| self.plan.has_temperature),
                level: has_level.then(|| Specific { forward: row.level_g[0], left: row.level_g[1] }),
                level_temp_c: None,
                lost_frames: 0,
                own: None,
                extra: row.channels.iter().skip(first_extra).copied().collect(),
            })?;
        }
        Ok(writer.finish()?)
    }
}

fn file_name(number: usize) -> String {
    format!("runs/{:03}.csv", number + 1)
}

/// Seconds since 1970 as a time of RFC 3339 in UTC (days to a date after Hinnant, "chrono-compatible low-level date
/// algorithms").
fn rfc_3339(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", second / 3600, second / 60 % 60, second % 60)
}

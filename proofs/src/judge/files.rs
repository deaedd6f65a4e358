//! A generated campaign as files, as anyone's campaign comes.

use std::path::Path;

use crate::hidden::{Campaign as Generated, Run as GeneratedRun};
use north_finder::sensing::level::Specific;

use north::campaign::{Campaign, CampaignWriter, Instrument, Layout, Role, Row, Run};
use north::file_error::FileError;

/// Name of run number `number`, from 0.
pub(super) fn run_name(number: usize) -> String {
    format!("runs/{:03}.csv", number + 1)
}

/// Writes the campaign into a new or empty folder. Its truth is not written.
pub fn write(generated: &Generated, folder: &Path) -> Result<Campaign, FileError> {
    let mut writer = CampaignWriter::create(Campaign {
        folder: folder.to_owned(),
        title: Some("drawn at random".into()),
        latitude_deg: Some(generated.latitude_deg),
        instrument: Some(Instrument {
            name: Some("simulated".into()),
            arw_deg_per_sqrt_h: Some(generated.arw_deg_per_sqrt_h),
            settings: None,
        }),
        runs: Vec::new(),
    })?;
    for (number, run) in generated.runs.iter().enumerate() {
        let file = run_name(number);
        write_run(generated, run, &writer, &file)?;
        writer.add(Run {
            file,
            role: if run.may_learn { Role::Fit } else { Role::Check },
            reference_azimuth_deg: run.reference_deg,
            reference_sigma_deg: run.reference_deg.map(|_| run.reference_sigma_deg),
            ..Run::default()
        });
    }
    writer.finish()?;
    Campaign::read(folder)
}

fn write_run(
    generated: &Generated,
    run: &GeneratedRun,
    campaign: &CampaignWriter,
    file: &str,
) -> Result<(), FileError> {
    let first_extra = usize::from(generated.has_temperature);
    let layout = Layout {
        temperature: generated.has_temperature,
        level: generated.has_level,
        level_temperature: false,
        lost_frames: false,
        own: None,
        extra: generated.channels.iter().skip(first_extra).cloned().collect(),
    };
    let mut writer = campaign.run(file, layout)?;
    for row in &run.rows {
        writer.write(&Row {
            t_s: row.t_s,
            interval_s: 1.0,
            index_deg: row.index_deg,
            fog_arcsec: row.fog_arcsec,
            temp_c: row.channels.first().copied().filter(|_| generated.has_temperature),
            level: generated.has_level.then(|| Specific { forward: row.level_g[0], left: row.level_g[1] }),
            level_temp_c: None,
            lost_frames: 0,
            own: None,
            extra: row.channels.iter().skip(first_extra).copied().collect(),
        })?;
    }
    writer.finish()
}

//! A campaign's runs for the search: those that may be learned from, and those that are only judged.

use north_finder::effects::now::RunFacts;
use north_finder::settings::Settings;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use super::rows::Run;
use crate::campaign::{Campaign, Role};
use crate::diagnose::{Options, Refusal, data};

/// The runs of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    pub fit: Vec<Run>,
    pub check: Vec<Run>,
}

/// Reads a campaign; a run without a row at rest, or with neither a reference nor an azimuth of its own, is left out.
///
/// Errors: a file cannot be read or is wrong somewhere; a latitude next to a pole.
pub fn read(campaign: &Campaign, settings: &Settings) -> Result<Runs, Refusal> {
    let options = Options { settings: settings.clone(), ..Options::default() };
    let (data, _) = data::read(campaign, &options)?;
    let mut runs = Runs::default();
    for (data, facts) in data.iter().zip(facts(campaign)) {
        if let Some(run) = Run::new(data, facts) {
            if data.role == Role::Fit { &mut runs.fit } else { &mut runs.check }.push(run);
        }
    }
    Ok(runs)
}

/// Time of day at every run's start, and the rest since the start of the run before it.
fn facts(campaign: &Campaign) -> Vec<RunFacts> {
    let start_s = |text: &str| OffsetDateTime::parse(text, &Rfc3339).ok().map(|time| time.unix_timestamp() as f64);
    let starts: Vec<Option<f64>> = campaign.runs.iter().map(|run| run.started.as_deref().and_then(start_s)).collect();
    let before =
        |own_s: f64| starts.iter().flatten().filter(|other_s| **other_s < own_s).copied().max_by(f64::total_cmp);
    starts
        .iter()
        .map(|own_s| RunFacts {
            hour_of_day: own_s.map(|own_s| (own_s / 3600.0).rem_euclid(24.0)),
            rest_s: own_s.and_then(|own_s| Some(own_s - before(own_s)?)),
        })
        .collect()
}

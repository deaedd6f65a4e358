//! A campaign's runs for the search: those that may be learned from, and those that are only judged.

use learn::Run;
use north_finder::settings::Settings;

use super::{Refusal, read};
use crate::campaign::{Campaign, Role};

/// The runs of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    pub fit: Vec<Run>,
    pub check: Vec<Run>,
}

/// Reads a campaign; a run without a row at rest, or with neither a reference nor an azimuth of its own, is left out.
///
/// Errors: a file cannot be read or is wrong somewhere; a latitude next to a pole.
pub fn to_search(campaign: &Campaign, settings: &Settings) -> Result<Runs, Refusal> {
    let (data, _) = read(campaign, settings)?;
    let mut runs = Runs::default();
    for data in &data {
        if let Some(run) = Run::new(data.recording(), campaign.runs.len()) {
            if data.role == Role::Fit { &mut runs.fit } else { &mut runs.check }.push(run);
        }
    }
    Ok(runs)
}

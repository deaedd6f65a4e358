//! Closing the loop with measured data: residual → effect → model → errors before and after, on runs that took no part.

mod result;

pub use result::{
    Candidate, Diagnosis, Effect, Experiment, NoiseTests, Rejected, RunDiagnosis, RunSeries, Spectra, Test, Warning,
};

use north_finder::settings::Settings;

use crate::campaign::Campaign;
use crate::file_error::FileError;

/// What may be chosen.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What is declared of the instrument, and the model that it runs now. The latitude is each run's own.
    pub settings: Settings,
}

/// Why a campaign cannot be diagnosed at all.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    #[error(transparent)]
    File(#[from] FileError),
    /// The campaign as a whole does not allow it.
    #[error("{0}")]
    Campaign(String),
    /// A run makes no sense; `line` counts the header as 1.
    #[error("{run}{}: {problem}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Run { run: String, line: Option<u64>, problem: String },
}

/// Diagnoses a campaign.
pub fn diagnose(campaign: &Campaign, options: &Options) -> Result<Diagnosis, Refusal> {
    let _ = (campaign, options);
    Err(Refusal::Campaign("not a campaign that can be learned from".into()))
}

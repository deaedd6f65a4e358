//! `north diagnose`: closes the loop with measured data.

use std::path::PathBuf;

use clap::Args;
use time::OffsetDateTime;

use super::fleet::family;
use crate::campaign::Campaign;
use crate::count::counted;
use crate::diagnose::{Options, diagnose, write};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::model_file::ModelFile;
use crate::output::JsonOption;
use crate::progress;
use crate::report::{self, ReportOption};
use crate::settings_file::{campaign_settings, write_model};

/// Find the effect that the model lacks, add it, and report the error before and after
///
/// Runs with the role "fit" may be learned from; runs with the role "check" are only judged. Without check runs that
/// have a reference, the fit runs are judged by cross-validation.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north diagnose acceptance-unit-7 --model-out unit-7.toml --report unit-7.html")]
pub struct Diagnose {
    /// A campaign: its folder or its campaign.toml
    #[arg(value_name = "CAMPAIGN")]
    campaign: PathBuf,
    /// The error model that the instrument runs now; what is found is added to it
    #[arg(long, value_name = "M.toml")]
    model: Option<PathBuf>,
    /// Settings (declared noise, thresholds), laid over the defaults
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    /// Write the error model with the effects in it, for `north solve --model` and for a board
    #[arg(long, value_name = "M.toml")]
    model_out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    /// What the instruments of its type have in common, from "north fleet learn": few runs suffice then
    #[arg(long, value_name = "F.toml")]
    fleet: Option<PathBuf>,
    /// Judge every run by what was learned from all others, also in a campaign of more than eight runs
    #[arg(long)]
    leave_one_out: bool,
    #[command(flatten)]
    json: JsonOption,
}

impl Diagnose {
    /// Whether the results can be written, over none of the files that are read.
    fn check_results(&self, campaign: &Campaign) -> Result<(), FileError> {
        let results = [self.model_out.as_deref(), self.report.path(), self.json.path()];
        let named = [&self.model, &self.settings, &self.fleet].into_iter().flatten().cloned();
        let read: Vec<PathBuf> = named.chain(campaign.files(&self.campaign)).collect();
        crate::output::check_beside(read.iter().map(PathBuf::as_path), results)
    }

    pub fn run(self) -> Result<(), Failure> {
        let campaign = Campaign::read(&self.campaign)?;
        self.check_results(&campaign)?;
        campaign.check_copies()?;
        let mut settings = campaign_settings(&campaign, self.settings.as_deref())?;
        if let Some(path) = &self.model {
            settings.latitude_deg = campaign.latitude_deg.unwrap_or(settings.latitude_deg);
            ModelFile::read(path)?.apply(&mut settings)?;
        }
        let family = family(self.fleet.as_deref())?;
        let options = Options { settings, leave_one_out: self.leave_one_out, family };
        let what = format!("diagnosing {}", counted(campaign.runs.len(), "run"));
        let mut diagnosis = progress::work(what, move || diagnose(&campaign, &options))?
            .map_err(|refusal| Failure::Refused(refusal.to_string()))?;
        write(&mut self.json.human(), &diagnosis)?;
        if let Some(path) = &self.model_out {
            write_model(path, &diagnosis.model)?;
        }
        self.report.write(|| {
            diagnosis.origin.made = Some(OffsetDateTime::now_utc().date().to_string());
            report::diagnosis::html(&diagnosis)
        })?;
        self.json.write(&diagnosis)
    }
}

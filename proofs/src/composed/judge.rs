//! What a diagnosis and the model that it wrote make of a composed campaign, against its truth.
//!
//! The engine is a black box here: what it says is read as anyone reads it, from its JSON and from the model's file.

use std::path::Path;

use north::campaign::{Campaign, Run};
use north::diagnose::{Options, diagnose};
use north::failure::Failure;
use north::model_file::ModelFile;
use north::settings_file::{campaign_settings, write_model};
use north::solve::solve_file;
use north_finder::settings::Settings;
use serde::Serialize;
use serde_json::Value;

use super::files::{RunTruth, Truth};
use super::{Kind, apart_deg};
use crate::statistics::rms;

/// A judged campaign.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    pub campaign: u64,
    pub kind: Kind,
    pub ports: Vec<String>,
    pub names: Vec<String>,
    pub composition: Vec<String>,
    /// Effects that were named.
    pub found: Vec<String>,
    pub unexplained: bool,
    /// Why there was no diagnosis, or no azimuth by the model.
    pub refusal: Option<String>,
    /// Plain errors of the check runs, rms, degrees, and the oracle's.
    pub before_deg: f64,
    pub oracle_deg: f64,
    /// By the model that was written.
    pub model: Option<Azimuths>,
    /// As the diagnosis reported them.
    pub reported: Option<Azimuths>,
}

impl Verdict {
    /// Errors of these azimuths over the oracle's, rms; without azimuths worse than any.
    pub fn ratio(&self, azimuths: Option<&Azimuths>) -> f64 {
        azimuths.map_or(f64::INFINITY, |azimuths| azimuths.rms_deg / self.oracle_deg)
    }

    /// The same of those by the written model.
    pub fn over_oracle(&self) -> f64 {
        self.ratio(self.model.as_ref())
    }

    /// The hidden effects.
    pub fn hidden(&self) -> String {
        if self.names.is_empty() { "nothing".into() } else { self.names.join(" + ") }
    }

    /// How many check runs are inside their intervals by the written model, of how many.
    pub fn covered(&self) -> String {
        self.model.as_ref().map_or("–".into(), |one| format!("{} of {}", one.covered, one.errors_deg.len()))
    }

    /// What was named, and what was said of it.
    pub fn what_was_found(&self) -> String {
        let found = if self.found.is_empty() { "nothing".into() } else { self.found.join(", ") };
        let unexplained = if self.unexplained { "; unexplained" } else { "" };
        let refused = self.refusal.as_ref().map(|why| format!("; refused: {why}")).unwrap_or_default();
        found + unexplained + &refused
    }
}

/// Azimuths of the check runs against the truth.
#[derive(Debug, Clone, Serialize)]
pub struct Azimuths {
    /// Error and sigma of each check run, degrees.
    pub errors_deg: Vec<f64>,
    pub sigmas_deg: Vec<f64>,
    /// Check runs whose azimuth ± 1.96 sigma holds the truth.
    pub covered: usize,
    pub rms_deg: f64,
}

/// Half a 95 % interval in sigmas.
const INTERVAL_95: f64 = 1.959_964;

impl Azimuths {
    /// Azimuths and sigmas of the check runs; `None` where one lacks.
    fn of(checks: &[&RunTruth], told: impl Fn(&str) -> Option<[f64; 2]>) -> Option<Self> {
        let told: Vec<[f64; 2]> = checks.iter().map(|run| told(&run.file)).collect::<Option<_>>()?;
        let errors_deg: Vec<f64> =
            checks.iter().zip(&told).map(|(run, told)| apart_deg(told[0], run.true_azimuth_deg)).collect();
        let sigmas_deg: Vec<f64> = told.iter().map(|told| told[1]).collect();
        Some(Self {
            covered: covered(&errors_deg, &sigmas_deg),
            rms_deg: rms(errors_deg.iter().copied()),
            errors_deg,
            sigmas_deg,
        })
    }
}

/// Of azimuths with these errors and sigmas those whose azimuth ± 1.96 sigma holds the truth.
pub fn covered(errors_deg: &[f64], sigmas_deg: &[f64]) -> usize {
    errors_deg.iter().zip(sigmas_deg).filter(|(error, sigma)| error.abs() <= INTERVAL_95 * **sigma).count()
}

/// Diagnoses the campaign in this folder, solves its check runs with the model that was written, and compares.
pub fn judge(folder: &Path, number: u64) -> Result<Verdict, Failure> {
    let text = std::fs::read_to_string(folder.join("truth.json"))?;
    let truth: Truth = serde_json::from_str(&text).map_err(std::io::Error::other)?;
    let mut verdict = Verdict {
        campaign: number,
        kind: truth.kind,
        ports: truth.ports,
        names: truth.names,
        composition: truth.composition,
        found: Vec::new(),
        unexplained: false,
        refusal: None,
        before_deg: truth.before_rms_deg,
        oracle_deg: truth.oracle_rms_deg,
        model: None,
        reported: None,
    };
    let checks: Vec<&RunTruth> = truth.runs.iter().filter(|run| run.role == "check").collect();
    let campaign = Campaign::read(folder)?;
    let settings = campaign_settings(&campaign, None)?;
    let diagnosis = match diagnose(&campaign, &Options { settings: settings.clone(), ..Options::default() }) {
        Ok(diagnosis) => diagnosis,
        Err(refusal) => {
            verdict.refusal = Some(refusal.to_string());
            return Ok(verdict);
        }
    };
    let json = serde_json::to_value(&diagnosis).map_err(std::io::Error::other)?;
    let listed = |name: &str| json[name].as_array().into_iter().flatten();
    verdict.found = listed("effects").filter_map(|effect| effect["name"].as_str().map(str::to_owned)).collect();
    verdict.unexplained = json["unexplained"].as_bool().unwrap_or(false);
    verdict.reported = Azimuths::of(&checks, |file| {
        let run = listed("runs").find(|run| run["file"].as_str() == Some(file))?;
        let number = |name: &str| run.get(name).and_then(Value::as_f64);
        Some([number("azimuth_after_deg")?, number("sigma_after_deg")?])
    });
    let temporary = tempfile::tempdir()?;
    let path = temporary.path().join("model.toml");
    let solved = write_model(&path, &diagnosis.model).map_err(|error| error.to_string()).and_then(|()| {
        let model = ModelFile::read(&path).map_err(|error| error.to_string())?;
        let judged = |run: &Run| checks.iter().any(|check| check.file == run.file);
        campaign.runs.iter().zip(campaign.facts()).filter(|(run, _)| judged(run)).try_fold(
            Vec::new(),
            |mut solved, (run, facts)| {
                let latitude_deg = campaign.latitude_of(run).unwrap_or(settings.latitude_deg);
                let mut settings = Settings { latitude_deg, ..settings.clone() };
                model.apply(&mut settings).map_err(|error| error.to_string())?;
                let fix = solve_file(&campaign.path_of(run), &settings, facts).map_err(|error| error.to_string())?.fix;
                solved.push((run.file.clone(), [fix.azimuth_deg, fix.sigma_deg]));
                Ok(solved)
            },
        )
    });
    match solved {
        Ok(solved) => {
            verdict.model =
                Azimuths::of(&checks, |file| solved.iter().find(|(name, _)| name == file).map(|(_, told)| *told));
        }
        Err(why) => verdict.refusal = Some(why),
    }
    Ok(verdict)
}

//! What the channels of a still recording do to the rate: the same diagnosis as that of a campaign, and its part of the Allan deviation.

use std::path::Path;

use north_finder::settings::Settings;
use serde::Serialize;

use super::noise::{Point, allan};
use crate::campaign::{Campaign, RunReader};
use crate::diagnose::{self, Diagnosis, Options};
use crate::failure::Failure;
use crate::run_data::{self, Sample};

/// The Earth's rate along an axis that does not turn is part of the bias: any latitude at which there is one will do.
const ANY_LATITUDE_DEG: f64 = 45.0;

/// What the channels explain.
#[derive(Clone, Debug, Serialize)]
pub struct Channels {
    /// Effects that were found in the first half of the recording, by their names.
    pub effects: Vec<String>,
    /// Rate about its mean in the second half, from which nothing was learned, °/h rms.
    pub rate_rms_before_deg_h: f64,
    pub rate_rms_after_deg_h: f64,
    /// Allan deviation of what the effects do to the rate, and of what they leave.
    pub part: Vec<Point>,
    pub left: Vec<Point>,
}

/// Learns the rate against the channels of a still recording. `None`: it has no channels, or they explain nothing.
///
/// Errors: as those of a diagnosis.
pub fn of(path: &Path) -> Result<Option<Channels>, Failure> {
    let reader = RunReader::open(path)?;
    if reader.channels().is_empty() && !reader.has_temperature() && !reader.has_level() {
        return Ok(None);
    }
    let campaign = Campaign::of_bare_run(path, ANY_LATITUDE_DEG);
    let refused = |refusal: run_data::Refusal| Failure::Refused(refusal.to_string());
    let settings = Settings::default();
    let options = Options { settings: settings.clone(), ..Options::default() };
    let diagnosis = diagnose::diagnose(&campaign, &options).map_err(refused)?;
    let Diagnosis { effects, rate_rms_before_deg_h, rate_rms_after_deg_h, model, .. } = diagnosis;
    let (Some(rate_rms_before_deg_h), Some(rate_rms_after_deg_h)) = (rate_rms_before_deg_h, rate_rms_after_deg_h)
    else {
        return Ok(None);
    };
    if effects.is_empty() {
        return Ok(None);
    }
    let (runs, _) = run_data::read(&campaign, &settings).map_err(refused)?;
    let Some(run) = runs.first() else { return Ok(None) };
    let with = run.with(&model);
    let of = |rate_deg_h: &dyn Fn(&Sample, &Sample) -> f64| {
        let mut angle_arcsec = vec![0.0];
        for (before, after) in run.samples.iter().zip(&with.samples) {
            let last = angle_arcsec.last().copied().unwrap_or_default();
            angle_arcsec.push(last + rate_deg_h(before, after) * before.seconds);
        }
        let seconds: f64 = run.samples.iter().map(|sample| sample.seconds).sum();
        allan(&angle_arcsec, seconds / run.samples.len() as f64)
    };
    Ok(Some(Channels {
        effects: effects.iter().map(diagnose::Effect::full_name).collect(),
        rate_rms_before_deg_h,
        rate_rms_after_deg_h,
        part: of(&|before, after| before.rate_deg_h - after.rate_deg_h),
        left: of(&|_, after| after.rate_deg_h),
    }))
}

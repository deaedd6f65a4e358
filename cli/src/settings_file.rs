//! The firmware's settings and its error model, from files.
//!
//! A file says only what differs: the rest keeps the value that it had.

use std::path::Path;

use hal_sim::Scenario;
use hal_sim::scenario::GyroFormat as SimulatedFormat;
use north_finder::effects::ErrorModel;
use north_finder::settings::{GyroFormat, Invalid, Settings};

use crate::campaign::Campaign;
use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

/// Name of the table of a scenario that holds settings of the firmware.
const TABLE: &str = "instrument";
/// The format number of model files.
const MODEL_FORMAT: i64 = 1;

/// Reads an error model: `format = 1` and the fields of [`ErrorModel`].
///
/// Errors: no such file, another format, unknown fields, values that make no sense.
pub fn read_model(path: &Path) -> Result<ErrorModel, FileError> {
    let file = TomlFile::read(path)?;
    let model: ErrorModel = file.parse_format(MODEL_FORMAT)?;
    model.validate().map_err(|invalid| {
        // In settings the model is a table of its own; here it is the file.
        let field = invalid.field.strip_prefix("model.").unwrap_or(invalid.field);
        invalid_at(&file, None, field, &invalid)
    })?;
    Ok(model)
}

/// Reads an error model for a board.
///
/// Errors: as [`read_model`]; a term that follows a channel which no board measures, by the channel's name.
pub fn read_board_model(path: &Path) -> Result<ErrorModel, FileError> {
    let model = read_model(path)?;
    match model.off_board() {
        None => Ok(model),
        Some(channel) => {
            let value = format!("a term that follows channel `{}`", channel.as_str());
            let allowed = "what a board measures: temp_c, ax_g, ay_g, its time and its index angle";
            Err(FileError::whole(path, Problem::not_allowed(value, allowed)))
        }
    }
}

/// Writes an error model, as [`read_model`] reads it. A file that is there is replaced.
///
/// Errors: the file cannot be written.
pub fn write_model(path: &Path, model: &ErrorModel) -> Result<(), FileError> {
    let text = model_text(model).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
    std::fs::write(path, text).map_err(|error| FileError::whole(path, error))
}

/// An error model as the text of a file that [`read_model`] reads.
pub fn model_text(model: &ErrorModel) -> Result<String, toml::ser::Error> {
    Ok(format!("format = {MODEL_FORMAT}\n{}", toml::to_string(model)?))
}

/// Writes settings, as [`read_settings`] reads them.
///
/// Errors: the file cannot be written.
pub fn write_settings(path: &Path, settings: &Settings) -> Result<(), FileError> {
    let text = toml::to_string(settings).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
    std::fs::write(path, text).map_err(|error| FileError::whole(path, error))
}

/// The settings that all runs of a campaign share (all but the latitude): the defaults with the gyro's noise declared, over
/// them those that the instrument had, over these the file `settings`, and the error model `model`.
pub fn campaign_settings(
    campaign: &Campaign,
    settings: Option<&Path>,
    model: Option<&Path>,
) -> Result<Settings, FileError> {
    let mut result = Settings::default();
    if let Some(instrument) = &campaign.instrument {
        if let Some(arw) = instrument.arw_deg_per_sqrt_h {
            declare_noise(&mut result, arw);
        }
        if let Some(file) = &instrument.settings {
            result = read_settings(&campaign.folder.join(file), &result)?;
        }
    }
    if let Some(path) = settings {
        result = read_settings(path, &result)?;
    }
    if let Some(path) = model {
        result.model = Some(read_model(path)?);
    }
    Ok(result)
}

/// Reads settings; what the file does not say stays as in `base`.
///
/// Errors: no such file, unknown fields, wrong types, values that are not allowed, alone or together.
pub fn read_settings(path: &Path, base: &Settings) -> Result<Settings, FileError> {
    checked(&TomlFile::read(path)?, None, base)
}

/// The settings for a scenario: the defaults at its latitude and with its gyro's frame format, and over them its table
/// `[instrument]`.
///
/// `file` is the scenario's own file, if it came from one: errors then name the line.
pub fn scenario_settings(scenario: &Scenario, file: Option<&Path>) -> Result<Settings, FileError> {
    let mut base = Settings { latitude_deg: scenario.site.latitude_deg, ..Settings::default() };
    base.gyro.format = match scenario.gyro.format {
        SimulatedFormat::Compact => GyroFormat::Compact,
        SimulatedFormat::KvhA => GyroFormat::KvhA,
    };
    match file {
        Some(path) => checked(&TomlFile::read(path)?, Some(TABLE), &base),
        None => {
            let name = format!("scenario {}", scenario.name);
            let text = toml::to_string(&scenario.instrument)
                .map_err(|error| FileError::whole(Path::new(&name), Problem::Syntax(error.to_string())))?;
            checked(&TomlFile::of_text(Path::new(&name), text), None, &base)
        }
    }
}

/// Declares the gyro's angle random walk (°/√h), and raises the gates' thresholds as far as such a gyro at rest needs.
pub fn declare_noise(settings: &mut Settings, arw_deg_per_sqrt_h: f64) {
    let noise_deg_h = 60.0 * arw_deg_per_sqrt_h;
    settings.gyro.arw_deg_per_sqrt_h = arw_deg_per_sqrt_h;
    let disturbance = &mut settings.disturbance.threshold_deg_h;
    *disturbance = disturbance.max(settings.gyro.bias_limit_deg_h + 6.0 * noise_deg_h);
    let jitter = &mut settings.jitter.threshold_deg_h;
    *jitter = jitter.max(6.0 * std::f64::consts::SQRT_2 * noise_deg_h);
}

fn checked(file: &TomlFile, table: Option<&str>, base: &Settings) -> Result<Settings, FileError> {
    let settings = file.parse_over(base, table)?;
    settings.validate().map_err(|invalid| invalid_at(file, table, invalid.field, &invalid))?;
    Ok(settings)
}

fn invalid_at(file: &TomlFile, table: Option<&str>, field: &str, invalid: &Invalid) -> FileError {
    let problem = Problem::not_allowed(format!("{field} = {}", invalid.value), invalid.allowed);
    file.at_field(table, field, problem)
}

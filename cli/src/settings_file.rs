//! The firmware's settings and its error model, from files.
//!
//! A file says only what differs: the rest keeps the value that it had.

use std::path::Path;

use hal_sim::Scenario;
use north_finder::effects::ErrorModel;
use north_finder::settings::{AccelerometerCalibration, Invalid, Settings};
pub use simulated::declare_noise;
use simulated::default_settings;

use crate::campaign::Campaign;
use crate::file_error::{FileError, Problem};
use crate::model_file::FORMAT;
use crate::toml_file::TomlFile;

/// Name of the table of a scenario that holds settings of the firmware.
const TABLE: &str = "instrument";

/// Writes an error model, as [`ModelFile::read`](crate::model_file::ModelFile::read) reads it. A file that is there is replaced.
///
/// Errors: the file cannot be written.
pub fn write_model(path: &Path, model: &ErrorModel) -> Result<(), FileError> {
    let text = model_text(model).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
    crate::output::write(path, text).map_err(|error| FileError::whole(path, error))
}

/// An error model as the text of a file that `read_model` reads.
pub fn model_text(model: &ErrorModel) -> Result<String, toml::ser::Error> {
    Ok(format!("format = {FORMAT}\n{}", toml::to_string(model)?))
}

/// Settings as the text of a file that [`read_settings`] reads.
pub fn settings_text(settings: &Settings) -> Result<String, toml::ser::Error> {
    toml::to_string(settings)
}

/// Writes settings, as [`read_settings`] reads them.
///
/// Errors: the file cannot be written.
pub fn write_settings(path: &Path, settings: &Settings) -> Result<(), FileError> {
    let text = settings_text(settings).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
    crate::output::write(path, text).map_err(|error| FileError::whole(path, error))
}

/// The settings that all runs of a campaign share (all but the latitude and a model): the defaults with the gyro's noise
/// declared, over them those that the instrument had, over these the file `settings`. Accelerometers of a recording without the
/// instrument's settings are taken as calibrated: what was done to their readings, nobody says.
pub fn campaign_settings(campaign: &Campaign, settings: Option<&Path>) -> Result<Settings, FileError> {
    let mut result = Settings::default();
    if let Some(instrument) = &campaign.instrument {
        if let Some(arw) = instrument.arw_deg_per_sqrt_h {
            declare_noise(&mut result, arw);
        }
        if let Some(file) = &instrument.settings {
            result = read_settings(&campaign.folder.join(file), &result)?;
        }
    }
    if campaign.instrument.as_ref().is_none_or(|instrument| instrument.settings.is_none()) {
        result.accelerometer = Some(AccelerometerCalibration::UNIT);
    }
    match settings {
        Some(path) => read_settings(path, &result),
        None => Ok(result),
    }
}

/// Reads settings; what the file does not say stays as in `base`.
///
/// Errors: no such file, unknown fields, wrong types, values that are not allowed, alone or together.
pub fn read_settings(path: &Path, base: &Settings) -> Result<Settings, FileError> {
    checked(&TomlFile::read(path)?, None, base)
}

/// The same of a text that did not come from a file; `name` is what errors call it.
pub fn laid_over(name: &str, text: String, base: &Settings) -> Result<Settings, FileError> {
    checked(&TomlFile::of_text(Path::new(name), text), None, base)
}

/// The settings for a scenario: the defaults at its latitude and with its gyro's frame format, and over them its table
/// `[instrument]`.
///
/// `file` is the scenario's own file, if it came from one: errors then name the line.
pub fn scenario_settings(scenario: &Scenario, file: Option<&Path>) -> Result<Settings, FileError> {
    let base = default_settings(scenario);
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

fn checked(file: &TomlFile, table: Option<&str>, base: &Settings) -> Result<Settings, FileError> {
    let settings = file.parse_over(base, table)?;
    let mut errors: Vec<_> = settings.violations().map(|invalid| invalid_at(file, table, &invalid)).collect();
    match errors.len() {
        0 => Ok(settings),
        1 => Err(errors.remove(0)),
        _ => Err(file.whole(Problem::Several(errors))),
    }
}

fn invalid_at(file: &TomlFile, table: Option<&str>, invalid: &Invalid) -> FileError {
    let mut allowed = String::new();
    // Writing to a string does not fail.
    let _ = invalid.write_allowed(&mut allowed);
    let problem = Problem::not_allowed(format!("{} = {}", invalid.field, invalid.value), allowed);
    file.at_field(table, invalid.field, problem)
}

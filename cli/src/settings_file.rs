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
    file.check_single_precision(table)?;
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
    file.at_number(table, invalid.field, invalid.value, allowed)
}

#[cfg(test)]
mod tests {
    use north_finder::effects::ChannelName;
    use north_finder::effects::dynamics::Dynamics;
    use north_finder::effects::effect::{Effect, Port};
    use north_finder::effects::factor::Factor;
    use north_finder::effects::part::Span;
    use north_finder::effects::shape::{Linear, Shape};
    use north_finder::effects::signal::{Channel, Signal, WeightedDifference};
    use north_finder::sequence::order::Order;

    use super::*;
    use crate::model_file::ModelFile;

    /// Whatever may be learned can be written, and is read again as it was: a model with every signal, every dynamics and every shape alone.
    #[test]
    fn an_order_may_be_a_word_and_what_is_written_is_read_again() {
        let read = |text: &str| laid_over("s.toml", text.into(), &Settings::default()).map(|read| read.sequence.order);
        let two_degrees = Order::Adaptive { accuracy_deg: 2.0 };
        let angles = Order::Custom([0.0, 120.0, 240.0].into_iter().collect());
        for (text, order) in [
            ("\"adaptive\"", Order::ADAPTIVE),
            ("{ adaptive = {} }", Order::ADAPTIVE),
            ("{ adaptive = { accuracy_deg = 2.0 } }", two_degrees),
            ("\"rotation\"", Order::Rotation { passes: 20 }),
            ("{ rotation = { passes = 4 } }", Order::Rotation { passes: 4 }),
            ("\"east-west\"", Order::EastWest),
            ("{ custom = [0.0, 120.0, 240.0] }", angles),
        ] {
            assert_eq!(read(&format!("[sequence]\norder = {text}\n")).unwrap(), order, "{text}");
            let mut settings = Settings::default();
            settings.sequence.order = order.clone();
            assert_eq!(read(&settings_text(&settings).unwrap()).unwrap(), order);
        }
    }

    #[test]
    fn every_part_of_an_effect_is_written_and_read_again() {
        let line: Shape = Linear { reference: 0.25, scale: 1.5 }.into();
        let temperature: Signal = Channel { name: ChannelName::new("temp_c").unwrap() }.into();
        let span = |is_angle| Span {
            mean: 20.0,
            deviation: 3.0,
            low: 10.0,
            high: 30.0,
            is_angle,
            is_time: false,
            row_s: 1.0,
            longest_s: 600.0,
        };
        let mut factors: Vec<Factor> =
            Signal::without_channels().map(|signal| Factor::new(signal, &[], line)).collect();
        let (plus, minus) = (ChannelName::new("temp_c").unwrap(), ChannelName::new("supply_v").unwrap());
        let weighed = WeightedDifference { plus, minus, ratio: -0.5, reference: 12.0 };
        factors.push(Factor::new(weighed.into(), &[], line));
        Dynamics::starts(&span(false), &mut |dynamics| factors.push(Factor::new(temperature, &[dynamics], line)));
        for is_angle in [false, true] {
            Shape::starts(&span(is_angle), &mut |shape| factors.push(Factor::new(temperature, &[], shape)));
        }
        let folder = tempfile::tempdir().unwrap();
        for (number, factor) in factors.into_iter().enumerate() {
            let path = folder.path().join(format!("{number}.toml"));
            let mut model = ErrorModel::default();
            let mut effect = Effect::new(Port::Rate, std::slice::from_ref(&factor));
            effect.weights.iter_mut().for_each(|weight| *weight = 0.1);
            model.effects.push(effect).unwrap();
            write_model(&path, &model).unwrap_or_else(|error| panic!("{factor:?}: {error}"));
            let text = std::fs::read_to_string(&path).unwrap();
            let (_, tables) = text.split_once('\n').unwrap();
            let read: ErrorModel = toml::from_str(tables).unwrap_or_else(|error| panic!("{factor:?}: {error}"));
            assert_eq!(read, model);
            if model.validate().is_ok() {
                ModelFile::read(&path).unwrap_or_else(|error| panic!("{factor:?}: {error}"));
            }
        }
    }
}

//! Settings of a board: read, changed, kept in a file and brought back.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use north_finder::link::Ask;
use north_finder::settings::Settings;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use crate::failure::Failure;
use crate::file_error::FileError;
use crate::output;
use crate::port::{Port, PortOption};
use crate::settings_file::{laid_over, read_settings, settings_text};

/// Print settings of a board
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north settings get latitude_deg
  north settings get gyro model --port /dev/ttyUSB0")]
pub struct Get {
    /// Names of values or groups, as `north settings describe` has them; all without one
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    #[command(flatten)]
    port: PortOption,
}

/// Change settings of a board, which starts anew with them
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings set latitude_deg=47.37 sequence.order=mirrored")]
pub struct Set {
    /// Values by name
    #[arg(value_name = "NAME=VALUE", required = true)]
    values: Vec<String>,
    #[command(flatten)]
    port: PortOption,
}

/// Print all settings of a board, its error model among them, as a file that `restore` reads
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings dump --out unit-7.toml")]
pub struct Dump {
    /// Write to this new file instead of stdout
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    port: PortOption,
}

/// Bring the settings of a file to a board, which starts anew with them; what the file does not say gets its default
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings restore unit-7.toml")]
pub struct Restore {
    /// As `dump` writes it
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    port: PortOption,
}

/// Tell a board the time of day, which its log of fixes has from then on; it forgets it when it is switched off
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north settings clock --port /dev/ttyUSB0")]
pub struct Clock {
    #[command(flatten)]
    port: PortOption,
}

impl Clock {
    pub fn run(self) -> Result<(), Failure> {
        let mut port = self.port.open()?;
        let now = OffsetDateTime::now_utc();
        port.ask(Ask::SetClock { utc_s: now.unix_timestamp() as f64 }, &mut |_| ())?;
        let text = now.format(&Rfc3339).map_err(|error| Failure::Refused(error.to_string()))?;
        Ok(writeln!(output::people(), "{}: the clock is set to {text}", port.name())?)
    }
}

impl Get {
    pub fn run(self) -> Result<(), Failure> {
        let settings = stored(&mut self.port.open()?)?;
        let text = settings_text(&settings).map_err(|error| Failure::Refused(error.to_string()))?;
        let mut out = crate::output::people();
        if self.names.is_empty() {
            return Ok(write!(out, "{text}")?);
        }
        let all = toml::Value::try_from(&settings).map_err(|error| Failure::Refused(error.to_string()))?;
        for name in &self.names {
            let found = name.split('.').try_fold(&all, |value, part| value.get(part));
            match found {
                Some(value) if value.is_table() => writeln!(out, "{}", section_text(name, value)?)?,
                Some(value) => writeln!(out, "{name} = {value}")?,
                None => {
                    let known: Vec<&str> =
                        all.as_table().into_iter().flatten().map(|(name, _)| name.as_str()).collect();
                    let message = format!("{name} is not set on this board; what is: {}", known.join(", "));
                    return Err(Failure::Usage(message));
                }
            }
        }
        Ok(())
    }
}

/// A group under its whole name, groups in it too: a settings file by itself.
fn section_text(name: &str, group: &toml::Value) -> Result<String, Failure> {
    let whole = name
        .rsplit('.')
        .fold(group.clone(), |inner, part| toml::Value::Table(toml::Table::from_iter([(part.to_owned(), inner)])));
    toml::to_string(&whole).map_err(|error| Failure::Refused(error.to_string()))
}

impl Set {
    pub fn run(self) -> Result<(), Failure> {
        let text = self.values.iter().map(|value| line(value)).collect::<Result<String, Failure>>()?;
        let mut port = self.port.open()?;
        let before = port.settings()?;
        if before.is_none() && !self.values.iter().any(|value| value.starts_with("latitude_deg=")) {
            return Err(Failure::Refused(
                "the board has no settings yet: latitude_deg=… must be among the values".into(),
            ));
        }
        let settings = laid_over("command line", text, &before.unwrap_or_default())?;
        store(&mut port, &settings)
    }
}

/// `NAME=VALUE` as a line of TOML; a word needs no quotes.
fn line(value: &str) -> Result<String, Failure> {
    let (name, value) = value.split_once('=').ok_or_else(|| Failure::Usage(format!("{value:?} is not NAME=VALUE")))?;
    let plain = value.chars().all(|c| c.is_ascii_alphabetic() || c == '-')
        && !matches!(value, "true" | "false" | "nan" | "inf");
    Ok(if plain { format!("{name} = {value:?}\n") } else { format!("{name} = {value}\n") })
}

impl Dump {
    pub fn run(self) -> Result<(), Failure> {
        let settings = stored(&mut self.port.open()?)?;
        let text = settings_text(&settings).map_err(|error| Failure::Refused(error.to_string()))?;
        match &self.out {
            None => Ok(write!(crate::output::people(), "{text}")?),
            Some(path) => Ok(output::write(path, text).map_err(|error| FileError::whole(path, error))?),
        }
    }
}

impl Restore {
    pub fn run(self) -> Result<(), Failure> {
        let settings = read_settings(&self.file, &Settings::default())?;
        store(&mut self.port.open()?, &settings)
    }
}

/// The settings of a board that has some.
fn stored(port: &mut Port) -> Result<Settings, Failure> {
    port.settings()?.ok_or_else(|| Failure::Refused(format!("{}: no settings are stored", port.name())))
}

/// Stores settings, and says so.
pub fn store(port: &mut Port, settings: &Settings) -> Result<(), Failure> {
    port.store(settings)?;
    writeln!(crate::output::people(), "{}: stored; the board starts anew with these settings", port.name())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_printed_as_it_is_loaded() {
        let all: toml::Table = "[sequence]\ndwell_s = 45.0\n[sequence.order.adaptive]\nmost = 3\n".parse().unwrap();
        let text = section_text("sequence", &all["sequence"]).unwrap();
        assert_eq!(text.parse::<toml::Table>().unwrap(), all, "{text}");
        let inner = section_text("sequence.order", &all["sequence"]["order"]).unwrap();
        assert_eq!(inner.trim(), "[sequence.order.adaptive]\nmost = 3");
    }
}

//! `north load`: an error model, or settings, onto a board.

use std::path::PathBuf;

use clap::Args;

use super::settings;
use crate::failure::Failure;
use crate::model_file::ModelFile;
use crate::port::PortOption;
use crate::settings_file::read_settings;
use crate::toml_file::TomlFile;

/// Bring an error model, or settings, to a board, which starts anew with it
///
/// A model (a file with a key `format`) replaces what the board has of what the file says. Of settings only those that the
/// file says are changed.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north diagnose campaign --model-out m.toml && north load m.toml
  north load my-gyro.toml --port /dev/ttyUSB0")]
pub struct Load {
    /// A model, as `diagnose` and `calibrate` write it, or settings, as `characterise --settings-out` writes them
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    port: PortOption,
}

impl Load {
    pub fn run(self) -> Result<(), Failure> {
        let file = TomlFile::read(&self.file)?;
        let is_model = file.has("format")?;
        let model = if is_model { Some(ModelFile::read(&self.file)?) } else { None };
        let mut port = self.port.open()?;
        let before = port.settings()?;
        if before.is_none() && !file.has("latitude_deg")? {
            return Err(Failure::Refused(format!(
                "{}: the board has no settings yet: store some first, with the latitude (north settings set latitude_deg=…)",
                port.name()
            )));
        }
        let mut settings = before.unwrap_or_default();
        match model {
            Some(model) => model.apply_to_board(&mut settings)?,
            None => settings = read_settings(&self.file, &settings)?,
        }
        settings::store(&mut port, &settings)
    }
}

//! The north finder on the host: campaigns, settings, the simulated instrument around the firmware's pipeline, and the
//! verbs of the command `north`.

pub mod campaign;
pub mod engine;
pub mod file_error;
pub mod settings_file;
pub mod toml_file;

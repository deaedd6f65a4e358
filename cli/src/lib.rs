//! The north finder on the host: campaigns, settings, the simulated devices around the firmware's instrument, and the
//! verbs of the command `north`.

pub mod argument;
pub mod block_csv;
pub mod block_gate;
pub mod calibrate;
pub mod campaign;
pub mod characterise;
pub mod commands;
pub mod count;
pub mod dashboard;
pub mod diagnose;
pub mod engine;
pub mod failure;
pub mod field;
pub mod file_error;
pub mod fleet;
pub mod import;
pub mod input;
pub mod interrupt;
pub mod json;
pub mod model_file;
pub mod output;
mod parquet_table;
pub mod port;
pub mod present;
pub mod progress;
pub mod recorder;
pub mod report;
pub mod run_data;
pub mod service;
pub mod settings_file;
pub mod solve;
pub mod table_csv;
pub mod toml_file;
pub mod track;
pub mod voyage;

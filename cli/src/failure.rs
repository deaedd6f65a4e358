//! Why a command ended without success, and the exit code that says so.

use std::io;
use std::process::ExitCode;

use hal_sim::ScenarioError;

use crate::engine::EngineError;
use crate::engine::qemu::QemuError;
use crate::engine::qemu::image::ImageError;
use crate::file_error::FileError;

/// A command's end without success.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Options that make no sense.
    #[error("{0}")]
    Usage(String),
    /// The instrument or the data say no.
    #[error("{0}")]
    Refused(String),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// What was to be printed could not be.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
    #[error("interrupted")]
    Interrupted,
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        EngineError::from(QemuError::from(error)).into()
    }
}

impl Failure {
    /// 1: the instrument, the data or the machine say no; 2: usage; 130: interrupted, as shells have it.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            // Whoever reads our output has seen enough.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
            Self::Usage(_) | Self::Scenario(ScenarioError::UnknownName { .. }) => ExitCode::from(2),
            Self::Interrupted => ExitCode::from(130),
            _ => ExitCode::FAILURE,
        }
    }

    /// Whether there is anything to tell.
    pub fn is_silent(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}

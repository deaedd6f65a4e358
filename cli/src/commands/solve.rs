//! `north solve`: azimuths of recorded runs.

use clap::Args;

use crate::failure::Failure;

/// Solve the runs of a campaign, or one bare run, for their azimuths
#[derive(Args, Debug)]
pub struct Solve {}

impl Solve {
    pub fn run(self) -> Result<(), Failure> {
        Ok(())
    }
}

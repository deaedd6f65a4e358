//! `north export`: a campaign as a table for other engines.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use crate::campaign::{Campaign, write_parquet};
use crate::count::counted;
use crate::failure::Failure;
use crate::output::{self, people};

/// Write a campaign as one Parquet table: a row for every row of every run
///
/// Columns: run and role (text), latitude_deg, reference_azimuth_deg, t_s, index_deg, fog_arcsec, temp_c, ax_g, ay_g,
/// level_temp_c, lost_frames and every further channel (numbers; empty where a run has none).
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  north simulate --scenario warm-up --runs 12 --out warm && north export warm --out warm.parquet"
)]
pub struct Export {
    /// A campaign: its folder, or its campaign.toml
    #[arg(value_name = "CAMPAIGN")]
    campaign: PathBuf,
    /// The file to write
    #[arg(long, value_name = "FILE.parquet")]
    out: PathBuf,
}

impl Export {
    pub fn run(self) -> Result<(), Failure> {
        let campaign = Campaign::read(&self.campaign)?;
        let read = campaign.files(&self.campaign);
        output::check_beside(read.iter().map(PathBuf::as_path), [Some(self.out.as_path())])?;
        let rows = write_parquet(&campaign, &self.out)?;
        let (rows, runs) = (counted(rows, "row"), counted(campaign.runs.len(), "run"));
        Ok(writeln!(people(), "{}: {rows} of {runs}", self.out.display())?)
    }
}

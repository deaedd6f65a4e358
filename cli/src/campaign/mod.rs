//! Campaigns, format 1: a folder with a `campaign.toml` and runs as CSV files.

mod copies;
mod manifest;
mod run_csv;
mod writer;

pub use manifest::{Campaign, Instrument, Role, Run};
pub(crate) use manifest::{check_range, check_time};
pub use run_csv::{Row, RunReader};
pub use writer::{CampaignWriter, Layout, RunWriter};

/// Name of the file that describes a campaign, in its folder.
pub const MANIFEST: &str = "campaign.toml";

//! Campaigns, format 1: a folder with a `campaign.toml` and runs as CSV files.

mod clock;
mod copies;
mod manifest;
mod own;
mod run_csv;
mod table;
mod writer;

pub use clock::{check_step, doubt as doubt_of_clock};
pub use manifest::{Campaign, Instrument, Role, Run};
pub(crate) use manifest::{check_range, check_station, check_time};
pub use own::{ACCELEROMETERS, COMMON, INDEX, Own, TEMPERATURE};
pub use run_csv::{Row, RunReader};
pub use table::{Columns, write_parquet};
pub use writer::{CampaignWriter, Layout, OwnLayout, RunWriter};

/// Name of the file that describes a campaign, in its folder.
pub const MANIFEST: &str = "campaign.toml";
/// Settings that a recording was made with, and headings that were held after its fix.
pub const SETTINGS: &str = "settings.toml";
pub const HEADINGS: &str = "headings.csv";
/// In a folder whose recording is not finished, until it is.
pub const UNFINISHED: &str = "unfinished";

//! `north bench compose`: campaigns with composed hidden effects as files.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use north::failure::Failure;
use north::progress;
use serde::Serialize;

use super::{Bench, trials};
use crate::composed::{Campaign, Kind};

/// Write campaigns with effects that are composed at random, and their truth
///
/// Each campaign is a folder DIR/0000, DIR/0001 … with a truth.json beside its campaign.toml: true, plain and oracle's
/// azimuth of every run, and what is hidden.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench compose --campaigns 20 --seed 5 --kind inside --out composed")]
pub struct Compose {
    /// How many, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// What they hold; all: inside, outside, inside …, and every tenth empty
    #[arg(long, value_name = "KIND", default_value = "all")]
    kind: Kinds,
    /// Folder for the campaigns
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What campaigns are to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Kinds {
    Inside,
    Outside,
    Empty,
    All,
}

impl Kinds {
    /// What campaign number `number` holds.
    pub(super) fn of(self, number: u64) -> Kind {
        match self {
            Self::Inside => Kind::Inside,
            Self::Outside => Kind::Outside,
            Self::Empty => Kind::Empty,
            Self::All if number % 10 == 9 => Kind::Empty,
            Self::All if number.is_multiple_of(2) => Kind::Inside,
            Self::All => Kind::Outside,
        }
    }
}

/// One campaign.
#[derive(Serialize)]
pub struct Row {
    campaign: u64,
    kind: Kind,
    names: Vec<String>,
    draws: u64,
    before_rms_deg: f64,
    oracle_rms_deg: f64,
}

impl Bench for Compose {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.campaigns, "campaigns");
        let one = |number: u64| -> Result<Row, Failure> {
            let campaign = Campaign::draw(self.seed, number, self.kind.of(number));
            campaign.write(&self.out.join(format!("{number:04}")))?;
            let truth = campaign.truth();
            Ok(Row {
                campaign: number,
                kind: truth.kind,
                names: truth.names,
                draws: truth.draws,
                before_rms_deg: truth.before_rms_deg,
                oracle_rms_deg: truth.oracle_rms_deg,
            })
        };
        let rows = trials(0..self.campaigns, &bar, one)?.into_iter().collect::<Result<Vec<_>, _>>()?;
        bar.finish_and_clear();
        writeln!(
            out,
            "| campaign | kind | hidden | draws | plain, ° rms | oracle, ° rms |\n|---|---|---|---|---|---|"
        )?;
        for row in &rows {
            writeln!(
                out,
                "| {:04} | {:?} | {} | {} | {:.4} | {:.4} |",
                row.campaign,
                row.kind,
                row.names.join(" + "),
                row.draws,
                row.before_rms_deg,
                row.oracle_rms_deg
            )?;
        }
        Ok(rows)
    }
}

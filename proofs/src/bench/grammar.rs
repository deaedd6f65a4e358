//! `north bench grammar`: what the search over composed effects leaves of the rates of runs that took no part.

use std::io::Write;

use clap::Args;
use learn::{Allowed, Family, chi_square_by_freedom, learn};
use north::campaign::Campaign as Recorded;
use north::failure::Failure;
use north::progress;
use north::run_data::to_search;
use north::settings_file::campaign_settings;
use serde::Serialize;

use super::Bench;
use super::compose::Kinds;
use crate::composed::{Campaign, Kind};
use crate::statistics::median;

/// Effects composed at random, found by the search over composed effects: what is left of the rates of check runs
///
/// For every campaign the chi-square of the check runs' rates by degree of freedom, before and after the effects that were found are taken out; 1 is
/// white noise. A campaign with ten channels takes a minute and more.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench grammar --campaigns 10 --seed 5")]
pub struct GrammarBench {
    /// How many campaigns, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// What they hold; all: inside, outside, inside …, and every tenth empty
    #[arg(long, value_name = "KIND", default_value = "all")]
    kind: Kinds,
}

/// One campaign.
#[derive(Serialize)]
pub struct Row {
    campaign: u64,
    kind: Kind,
    hidden: Vec<String>,
    found: Vec<String>,
    /// Models that are nearly as likely as the best, it among them.
    models: usize,
    /// References that were not believed.
    blunders: usize,
    /// Median over the check runs.
    chi_square_before: f64,
    chi_square_after: f64,
}

impl GrammarBench {
    fn judge_one(&self, number: u64) -> Result<Row, Failure> {
        let campaign = Campaign::draw(self.seed, number, self.kind.of(number));
        let temporary = tempfile::tempdir()?;
        let folder = temporary.path().join("campaign");
        campaign.write(&folder)?;
        let recorded = Recorded::read(&folder)?;
        let settings = campaign_settings(&recorded, None)?;
        let runs = to_search(&recorded, &settings).map_err(|refusal| Failure::Refused(refusal.to_string()))?;
        let allowed = Allowed {
            family: &Family::default(),
            may_be_used: &|_, _| true,
            azimuths: &|_, runs| vec![None; runs.len()],
        };
        let learned = learn(runs.fit, &allowed);
        let left =
            |effects: &[_]| median(runs.check.iter().filter_map(|run| chi_square_by_freedom(run, effects)).collect());
        let truth = campaign.truth();
        Ok(Row {
            campaign: number,
            kind: truth.kind,
            hidden: truth.names,
            found: learned.best.posterior.effects.iter().map(ToString::to_string).collect(),
            models: learned.best.posterior.alternatives.len(),
            blunders: learned.blunders.len(),
            chi_square_before: left(&[]),
            chi_square_after: left(&learned.best.posterior.effects),
        })
    }
}

impl Bench for GrammarBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.campaigns, "campaigns");
        writeln!(
            out,
            "| campaign | kind | hidden | found | chi-square by degree of freedom, before | after |\n|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        // One after the other: a search uses all cores by itself.
        for number in 0..self.campaigns {
            let row = self.judge_one(number)?;
            writeln!(
                out,
                "| {:04} | {:?} | {} | {} | {:.2} | {:.2} |",
                row.campaign,
                row.kind,
                row.hidden.join(" + "),
                row.found.join(" + "),
                row.chi_square_before,
                row.chi_square_after
            )?;
            rows.push(row);
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(rows)
    }
}

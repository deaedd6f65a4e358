//! `north bench validation`: is the error that a diagnosis states without check runs correct in further runs of the same instrument?

use std::io::Write;

use clap::Args;
use north::campaign::Campaign as Recorded;
use north::diagnose::{Options, diagnose};
use north::failure::Failure;
use north::interrupt;
use north::progress;
use north::settings_file::campaign_settings;
use north_finder::effects::ErrorModel;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;
use serde::Serialize;

use super::Bench;
use super::compose::Kinds;
use crate::composed::{Campaign, Truth};
use crate::statistics::{MISSING_DEG, median};

/// Is the error that a diagnosis states without check runs correct in further runs of the same instrument?
///
/// Composed campaigns of which the diagnosis sees the fit runs alone, so that the error it states is its own validation's. The model that it learned
/// then solves further runs of the same instrument, whose azimuths are known to the bench. Campaigns with fewer than 16 surveyed fit runs are passed over.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench validation --campaigns 20 --seed 5 --verbose")]
pub struct ValidationBench {
    /// How many campaigns, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// What they hold; all: inside, outside, inside …, and every tenth empty
    #[arg(long, value_name = "KIND", default_value = "all")]
    kind: Kinds,
    /// Further runs of every instrument, 10 to 10000
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(10..=10_000))]
    runs: u64,
    /// Print every campaign
    #[arg(long)]
    verbose: bool,
}

/// Fewest surveyed fit runs of a campaign that counts: the stated error of n runs scatters by 1/√(2n), a sixth at 16.
const LEAST_RUNS: usize = 16;
/// Said less than this share of the truth flatters.
const FLATTERS: f64 = 0.7;
/// Growth of the error from which on a campaign is made worse.
const WORSE_BY: f64 = 1.05;

/// One campaign.
#[derive(Serialize)]
pub struct Row {
    campaign: u64,
    names: Vec<String>,
    found: Vec<String>,
    /// Error that the diagnosis states, degrees rms.
    said_deg: f64,
    /// Errors of the further runs by the model and without it, degrees rms.
    true_deg: f64,
    before_deg: f64,
}

impl Row {
    fn ratio(&self) -> f64 {
        self.said_deg / self.true_deg
    }
}

impl ValidationBench {
    /// `None` where the campaign does not count, or has no diagnosis.
    fn one(&self, number: u64) -> Result<Option<Row>, Failure> {
        let campaign = Campaign::draw(self.seed, number, self.kind.of(number));
        let fit = campaign.of_fit_runs();
        if fit.surveyed() < LEAST_RUNS {
            return Ok(None);
        }
        let temporary = tempfile::tempdir()?;
        let [shown, further] = ["shown", "further"].map(|name| temporary.path().join(name));
        fit.write(&shown)?;
        let fresh = campaign.fresh_runs(self.runs as usize, self.seed ^ number);
        fresh.write(&further)?;
        let recorded = Recorded::read(&shown)?;
        let settings = campaign_settings(&recorded, None)?;
        let Ok(diagnosis) = diagnose(&recorded, &Options { settings, ..Options::default() }) else { return Ok(None) };
        let Some(said_deg) = diagnosis.azimuth_rms_after_deg else { return Ok(None) };
        let errors = |model: &ErrorModel| errors_deg(&Recorded::read(&further)?, &fresh.truth(), model);
        Ok(Some(Row {
            campaign: number,
            names: campaign.truth().names,
            found: diagnosis.effects.iter().map(|effect| effect.full_name()).collect(),
            said_deg,
            true_deg: rms(&errors(&diagnosis.model)?),
            before_deg: rms(&errors(&ErrorModel::default())?),
        }))
    }
}

/// Errors of the runs with a model, degrees; a run without an azimuth is off by as much as an even distribution over the circle is.
fn errors_deg(recorded: &Recorded, truth: &Truth, model: &ErrorModel) -> Result<Vec<f64>, Failure> {
    let settings = campaign_settings(recorded, None)?;
    let (runs, _) = north::run_data::read(recorded, &settings).map_err(|why| Failure::Refused(why.to_string()))?;
    let error_deg = |run: &north::run_data::RunData| {
        let true_deg = truth.runs.iter().find(|known| known.file == run.file).map(|known| known.true_azimuth_deg)?;
        Some(run.replay(model, &mut |_| ()).map_or(MISSING_DEG, |fix| wrap_180_deg(fix.azimuth_deg - true_deg)))
    };
    Ok(runs.par_iter().filter_map(error_deg).collect())
}

fn rms(errors_deg: &[f64]) -> f64 {
    (errors_deg.iter().map(|error| error * error).sum::<f64>() / errors_deg.len() as f64).sqrt()
}

impl Bench for ValidationBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.campaigns, "campaigns");
        let mut rows: Vec<Row> = Vec::new();
        let mut number = 0;
        while (rows.len() as u64) < self.campaigns {
            if interrupt::requested() {
                return Err(Failure::Interrupted);
            }
            if let Some(row) = self.one(number)? {
                if self.verbose {
                    let found = if row.found.is_empty() { "nothing".to_owned() } else { row.found.join(", ") };
                    writeln!(
                        out,
                        "{number:04} {}: before {:.4}, stated {:.4}, true {:.4}, stated / true {:.2}; found {found}",
                        row.names.join(" + "),
                        row.before_deg,
                        row.said_deg,
                        row.true_deg,
                        row.ratio()
                    )?;
                    out.flush()?;
                }
                rows.push(row);
                bar.inc(1);
            }
            number += 1;
        }
        bar.finish_and_clear();
        let count = |is: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| is(row)).count();
        writeln!(
            out,
            "| campaigns | stated / true, median | below {FLATTERS} | made worse by more than 5 % |\n|---|---|---|---|"
        )?;
        writeln!(
            out,
            "| {} | {:.2} | {} | {} |",
            rows.len(),
            median(rows.iter().map(Row::ratio).collect()),
            count(&|row| row.ratio() < FLATTERS),
            count(&|row| row.true_deg > WORSE_BY * row.before_deg)
        )?;
        Ok(rows)
    }
}

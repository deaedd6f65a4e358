//! `north bench diagnose`: the diagnosis against hidden effects.

use std::io::{self, Write};

use crate::hidden::{Campaign as Generated, Family};
use clap::Args;
use serde::Serialize;

use super::{Bench, trials};
use crate::judge::{Summary, Verdict, consult, judge, summarize, write};
use north::diagnose::{Options, diagnose};
use north::failure::Failure;
use north::progress;
use north::settings_file::declare_noise;

/// Campaigns with a hidden effect, diagnosed and compared with an oracle who knows it
///
/// Every campaign is drawn anew: place, noise, orders, headings, channels that cause something and channels that do not.
/// The tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north bench diagnose --campaigns 20
  north bench diagnose --family channel-rate --campaigns 40 --verbose")]
pub struct DiagnoseBench {
    /// Campaigns of each family, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only this family
    #[arg(long, value_name = "NAME", value_parser = family)]
    family: Option<Family>,
    /// Only the campaign with this number, from 0; it is written into --out, if that is given
    #[arg(long, value_name = "N", requires = "family")]
    only: Option<u64>,
    /// A new or empty folder for the campaign of --only
    #[arg(long, value_name = "DIR", requires = "only")]
    out: Option<std::path::PathBuf>,
    /// Print what was hidden and what was found for each campaign
    #[arg(long)]
    verbose: bool,
}

/// One family.
#[derive(Serialize)]
pub struct FamilyReport {
    family: &'static str,
    #[serde(flatten)]
    summary: Summary,
}

impl Bench for DiagnoseBench {
    type Row = FamilyReport;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<FamilyReport>, Failure> {
        let families = self.family.map_or(Family::ALL.to_vec(), |family| vec![family]);
        let numbers = match self.only {
            Some(number) => number..number + 1,
            None => 0..self.campaigns,
        };
        let jobs: Vec<(Family, u64)> =
            families.iter().flat_map(|&family| numbers.clone().map(move |number| (family, number))).collect();
        let bar = progress::bar(jobs.len() as u64, "campaigns");
        let verdicts = trials(0..jobs.len() as u64, &bar, |job| {
            let (family, number) = jobs[job as usize];
            self.one(family, number)
        })?;
        bar.finish_and_clear();
        let verdicts = verdicts.into_iter().collect::<Result<Vec<_>, Failure>>()?;
        if self.verbose {
            verdicts.iter().try_for_each(|verdict| write_verdict(out, verdict))?;
        }
        let families: Vec<FamilyReport> = families
            .iter()
            .filter_map(|family| {
                let of_family: Vec<&Verdict> =
                    verdicts.iter().filter(|verdict| verdict.family == family.name()).collect();
                Some(FamilyReport { family: family.name(), summary: summarize(&of_family)? })
            })
            .collect();
        write_tables(out, &families)?;
        Ok(families)
    }
}

impl DiagnoseBench {
    /// Draws, diagnoses and judges one campaign.
    fn one(&self, family: Family, number: u64) -> Result<Verdict, Failure> {
        let place = Family::ALL.iter().position(|each| *each == family).unwrap_or_default() as u64;
        let generated = Generated::draw(family, self.seed, (place << 32) + number);
        let temporary = tempfile::tempdir()?;
        let folder = self.out.as_deref().unwrap_or(temporary.path());
        let campaign = write(&generated, folder)?;
        let mut options = Options::default();
        declare_noise(&mut options.settings, generated.arw_deg_per_sqrt_h);
        let diagnosis = diagnose(&campaign, &options).map_err(|refusal| refusal.to_string());
        let oracle = consult(&generated, &options.settings);
        Ok(judge(&generated, number, &diagnosis, &oracle))
    }
}

fn family(name: &str) -> Result<Family, String> {
    Family::named(name).ok_or_else(|| format!("families are: {}", Family::ALL.map(Family::name).join(", ")))
}

fn write_verdict(out: &mut dyn Write, verdict: &Verdict) -> io::Result<()> {
    let rms = |of: fn(&crate::judge::Errors) -> f64| {
        let sum: f64 = verdict.errors.iter().map(|errors| of(errors).powi(2)).sum();
        (sum / verdict.errors.len().max(1) as f64).sqrt()
    };
    writeln!(out, "{} {}: {}", verdict.family, verdict.number, verdict.hidden)?;
    if let Some(why) = &verdict.refusal {
        return writeln!(out, "    refused: {why}");
    }
    writeln!(
        out,
        "    {:?}, evidence {:.0}, found: {}{}",
        verdict.attribution,
        verdict.evidence,
        if verdict.found.is_empty() { "nothing".into() } else { verdict.found.join(", ") },
        if verdict.unexplained { "; something unexplained" } else { "" },
    )?;
    writeln!(
        out,
        "    rms in noise: before {:.2}, after {:.2}, oracle {:.2}, without the effect {:.2}",
        rms(|errors| errors.before),
        rms(|errors| errors.after),
        rms(|errors| errors.oracle),
        rms(|errors| errors.without),
    )
}

fn write_tables(out: &mut dyn Write, families: &[FamilyReport]) -> io::Result<()> {
    writeln!(
        out,
        "| family | campaigns | rms before, ° | after, ° | oracle, ° | after / oracle | right, % | ambiguous, % \
         | named falsely, % | unexplained, % | made worse, % |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    for FamilyReport { family, summary } in families {
        let family = Family::named(family).unwrap_or(Family::Nothing);
        let named = summary.visible > 0 && !family.is_foreign() && family != Family::Nothing;
        let right = if named && summary.telling > 0 {
            format!("{:.0} ± {:.0}", 100.0 * summary.right, 100.0 * summary.right_confidence_95)
        } else {
            "–".into()
        };
        let ambiguous = if named { format!("{:.0}", 100.0 * summary.ambiguous) } else { "–".into() };
        writeln!(
            out,
            "| {} | {} | {:.4} | {:.4} | {:.4} | {:.2} ({:.2} … {:.2}) | {right} | {ambiguous} | {:.0} | {:.0} | {:.0} |",
            family.describe(),
            summary.campaigns,
            summary.before_deg,
            summary.after_deg,
            summary.oracle_deg,
            summary.ratio.value,
            summary.ratio.low,
            summary.ratio.high,
            100.0 * if family.is_foreign() { summary.misnamed } else { summary.false_discovery },
            100.0 * summary.unexplained,
            100.0 * summary.made_worse,
        )?;
        if summary.refused > 0 {
            writeln!(out, "<!-- {}: {} campaigns refused -->", family.name(), summary.refused)?;
        }
    }
    Ok(())
}

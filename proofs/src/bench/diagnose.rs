//! `north bench diagnose`: the diagnosis against hidden effects.

use std::io::{self, Write};

use crate::composed;
use crate::hidden::{Campaign as Generated, Family, Group};
use clap::Args;
use serde::Serialize;

use super::Bench;
use super::compose::Kinds;
use super::composed::{Judged, Line, measure};
use crate::judge::{Summary, Verdict, consult, judge, summarize, write};
use crate::statistics::median;
use north::diagnose::{Options, diagnose};
use north::failure::Failure;
use north::interrupt;
use north::progress;
use north::settings_file::declare_noise;

/// Campaigns with a hidden effect, diagnosed and compared with an oracle who knows it
///
/// Every campaign is drawn anew: place, noise, orders, headings, channels that cause something and channels that do not.
/// The tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north bench diagnose --campaigns 20
  north bench diagnose --group outside --campaigns 4
  north bench diagnose --group composed --campaigns 200 --seed 5
  north bench diagnose --family channel-rate --campaigns 40 --verbose")]
pub struct DiagnoseBench {
    /// Campaigns of each family, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only the families of this group: nothing, named, outside, together; or composed: effects composed at random, of which
    /// --campaigns says the number of all
    #[arg(long, value_name = "NAME", value_parser = group, conflicts_with = "family")]
    group: Option<Chosen>,
    /// Of composed effects: what the campaigns hold; all: inside, outside, inside …, and every tenth empty
    #[arg(long, value_name = "KIND", default_value = "all", requires = "group")]
    kind: Kinds,
    /// Of composed effects: judge the folders DIR/0000, DIR/0001 … that `north bench compose` wrote
    #[arg(long, value_name = "DIR", requires = "group")]
    dir: Option<std::path::PathBuf>,
    /// Only these families, with commas between them
    #[arg(long, value_name = "NAME", value_parser = family, value_delimiter = ',')]
    family: Vec<Family>,
    /// Only the campaign with this number, from 0, of the --family or of the composed ones; it is written into --out, if that is given
    #[arg(long, value_name = "N", requires = "family")]
    only: Option<u64>,
    /// A new or empty folder for the campaign of --only
    #[arg(long, value_name = "DIR", requires = "only")]
    out: Option<std::path::PathBuf>,
    /// Print what was hidden and what was found for each campaign
    #[arg(long)]
    verbose: bool,
}

/// One line of one of the tables.
#[derive(Serialize)]
#[serde(tag = "table", rename_all = "kebab-case")]
pub enum Row {
    Family(FamilyReport),
    Group(GroupReport),
    Composed(Line),
    Campaign(composed::judge::Verdict),
}

/// A group of families, or effects that no family lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chosen {
    Families(Group),
    Composed,
}

/// One family.
#[derive(Serialize)]
pub struct FamilyReport {
    #[serde(skip)]
    family: Family,
    #[serde(rename = "family")]
    name: &'static str,
    #[serde(flatten)]
    summary: Summary,
}

/// All families of a group.
#[derive(Serialize)]
pub struct GroupReport {
    group: &'static str,
    families: usize,
    campaigns: usize,
    refused: usize,
    check_runs: usize,
    /// Median over the families of rms after over rms of the oracle.
    after_over_oracle_median: f64,
    /// Shares of the families, 0 to 1.
    within_1_25: f64,
    within_2: f64,
    /// Shares of check runs, 0 to 1, inside 95 % intervals: of all families, and of the worst with at least twenty, if there is one.
    coverage: f64,
    coverage_worst: Option<f64>,
    coverage_worst_family: Option<&'static str>,
    /// Families, as shares 0 to 1, whose coverage is below 85 %.
    coverage_below_85: f64,
    /// Shares of campaigns, 0 to 1.
    false_discovery: f64,
    unexplained: f64,
    made_worse: f64,
}

/// Check runs below which the coverage of a family says little.
const FEW_RUNS: usize = 20;

impl FamilyReport {
    fn coverage(&self) -> f64 {
        self.summary.covered as f64 / self.summary.runs as f64
    }
}

impl GroupReport {
    fn of(group: Group, families: &[FamilyReport]) -> Option<Self> {
        let of_group: Vec<_> = families.iter().filter(|report| report.family.group() == group).collect();
        let sum = |of: fn(&Summary) -> usize| of_group.iter().map(|report| of(&report.summary)).sum::<usize>();
        let campaigns = sum(|summary| summary.campaigns);
        let check_runs = sum(|summary| summary.runs);
        let of_campaigns = |share: fn(&Summary) -> f64| {
            let counts = of_group.iter().map(|report| share(&report.summary) * report.summary.campaigns as f64);
            counts.sum::<f64>() / campaigns as f64
        };
        let of_families = |is: &dyn Fn(&FamilyReport) -> bool| {
            of_group.iter().filter(|report| is(report)).count() as f64 / of_group.len() as f64
        };
        let enough = of_group.iter().filter(|report| report.summary.runs >= FEW_RUNS);
        let worst = enough.min_by(|a, b| a.coverage().total_cmp(&b.coverage()));
        (!of_group.is_empty()).then(|| Self {
            group: group.name(),
            families: of_group.len(),
            campaigns,
            refused: sum(|summary| summary.refused),
            check_runs,
            after_over_oracle_median: median(of_group.iter().map(|report| report.summary.ratio.value).collect()),
            within_1_25: of_families(&|report| report.summary.ratio.value <= 1.25),
            within_2: of_families(&|report| report.summary.ratio.value <= 2.0),
            coverage: sum(|summary| summary.covered) as f64 / check_runs as f64,
            coverage_worst: worst.map(|report| report.coverage()),
            coverage_worst_family: worst.map(|report| report.name),
            coverage_below_85: of_families(&|report| report.coverage() < 0.85),
            false_discovery: of_campaigns(|summary| summary.false_discovery),
            unexplained: of_campaigns(|summary| summary.unexplained),
            made_worse: of_campaigns(|summary| summary.made_worse),
        })
    }
}

impl Bench for DiagnoseBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let numbers = match self.only {
            Some(number) => number..number.saturating_add(1),
            None => 0..self.campaigns,
        };
        if self.group == Some(Chosen::Composed) {
            if self.out.is_some() {
                let other = "--out: north bench compose writes campaigns of composed effects".to_owned();
                return Err(Failure::Usage(other));
            }
            let judged =
                Judged { numbers, seed: self.seed, kinds: self.kind, dir: self.dir.as_deref(), verbose: self.verbose };
            let (lines, campaigns) = measure(&judged, out)?;
            return Ok(lines.into_iter().map(Row::Composed).chain(campaigns.into_iter().map(Row::Campaign)).collect());
        }
        let chosen = |family: &Family| {
            (self.family.is_empty() || self.family.contains(family))
                && self.group.is_none_or(|group| group == Chosen::Families(family.group()))
        };
        let families: Vec<Family> = Family::all().into_iter().filter(chosen).collect();
        let jobs: Vec<(Family, u64)> =
            families.iter().flat_map(|&family| numbers.clone().map(move |number| (family, number))).collect();
        let bar = progress::bar(jobs.len() as u64, "campaigns");
        // One after the other: a diagnosis uses all cores by itself.
        let mut verdicts: Vec<Verdict> = Vec::new();
        for (family, number) in jobs {
            let verdict = self.one(family, number)?;
            if interrupt::requested() {
                return Err(Failure::Interrupted);
            }
            if self.verbose {
                write_verdict(out, &verdict)?;
            }
            verdicts.push(verdict);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let families: Vec<FamilyReport> = families
            .iter()
            .filter_map(|family| {
                let of_family: Vec<&Verdict> =
                    verdicts.iter().filter(|verdict| verdict.family == family.name()).collect();
                Some(FamilyReport { family: *family, name: family.name(), summary: summarize(&of_family)? })
            })
            .collect();
        write_families(out, &families)?;
        let groups: Vec<GroupReport> =
            Group::ALL.into_iter().filter_map(|group| GroupReport::of(group, &families)).collect();
        write_groups(out, &groups)?;
        Ok(families.into_iter().map(Row::Family).chain(groups.into_iter().map(Row::Group)).collect())
    }
}

impl DiagnoseBench {
    /// Draws, diagnoses and judges one campaign.
    fn one(&self, family: Family, number: u64) -> Result<Verdict, Failure> {
        let place = Family::all().iter().position(|each| *each == family).unwrap_or_default() as u64;
        let generated = Generated::draw(family, self.seed, (place << 32) + number);
        let temporary = tempfile::tempdir()?;
        let folder = self.out.as_deref().unwrap_or(temporary.path());
        let campaign = write(&generated, folder)?;
        let mut options = Options::default();
        declare_noise(&mut options.settings, generated.arw_deg_per_sqrt_h);
        let work = move || {
            let diagnosis = diagnose(&campaign, &options).map_err(|refusal| refusal.to_string());
            let oracle = consult(&generated, &options.settings);
            judge(&generated, number, &diagnosis, &oracle)
        };
        // An interrupt ends it at once, not after the campaign.
        progress::interruptible(work, || ())
    }
}

pub fn family(name: &str) -> Result<Family, String> {
    Family::named(name).ok_or_else(|| {
        format!("families are: {}", Family::all().into_iter().map(Family::name).collect::<Vec<_>>().join(", "))
    })
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
        "    rms in noise: before {:.2}, after {:.2}, oracle {:.2}, without the effect {:.2}; covered {} of {}",
        rms(|errors| errors.before),
        rms(|errors| errors.after),
        rms(|errors| errors.oracle),
        rms(|errors| errors.without),
        verdict.errors.iter().filter(|errors| errors.is_covered()).count(),
        verdict.errors.len(),
    )
}

fn write_families(out: &mut dyn Write, families: &[FamilyReport]) -> io::Result<()> {
    writeln!(
        out,
        "| family | campaigns | rms before, ° | after, ° | oracle, ° | after / oracle | covered, % | right, % (95 %) | ambiguous, % \
         | named falsely, % | unexplained, % | made worse, % |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    for report in families {
        let FamilyReport { family, summary, .. } = report;
        let named = summary.visible > 0 && family.group() == Group::Named;
        let right = if named && summary.telling > 0 {
            let [low, high] = summary.right_interval.map(|share| 100.0 * share);
            format!("{:.0} ({low:.1} … {high:.1})", 100.0 * summary.right)
        } else {
            "–".into()
        };
        let ambiguous = if named { format!("{:.0}", 100.0 * summary.ambiguous) } else { "–".into() };
        writeln!(
            out,
            "| {} | {} | {:.4} | {:.4} | {:.4} | {:.2} ({:.2} … {:.2}) | {:.0} | {right} | {ambiguous} | {:.0} | {:.0} | {:.0} |",
            family.describe(),
            summary.campaigns,
            summary.before_deg,
            summary.after_deg,
            summary.oracle_deg,
            summary.ratio.value,
            summary.ratio.low,
            summary.ratio.high,
            100.0 * report.coverage(),
            100.0 * summary.false_discovery,
            100.0 * summary.unexplained,
            100.0 * summary.made_worse,
        )?;
        if summary.refused > 0 {
            writeln!(out, "<!-- {}: {} campaigns refused -->", family.name(), summary.refused)?;
        }
    }
    Ok(())
}

fn group(name: &str) -> Result<Chosen, String> {
    if name == "composed" {
        return Ok(Chosen::Composed);
    }
    let names = || Group::ALL.map(Group::name).join(", ");
    Group::ALL
        .into_iter()
        .find(|group| group.name() == name)
        .map(Chosen::Families)
        .ok_or_else(|| format!("there is no such group: {}, composed", names()))
}

fn write_groups(out: &mut dyn Write, groups: &[GroupReport]) -> io::Result<()> {
    writeln!(
        out,
        "\n| group | families | campaigns | after / oracle, median | ≤ 1.25, % | ≤ 2, % | covered, % | worst family, % \
         | families below 85 %, % | named falsely, % | unexplained, % | made worse, % |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    for group in groups {
        let worst = group.coverage_worst.zip(group.coverage_worst_family);
        let worst = worst.map_or("–".into(), |(share, family)| format!("{:.0} {family}", 100.0 * share));
        writeln!(
            out,
            "| {} | {} | {} | {:.2} | {:.0} | {:.0} | {:.1} | {worst} | {:.0} | {:.1} | {:.1} | {:.1} |",
            group.group,
            group.families,
            group.campaigns,
            group.after_over_oracle_median,
            100.0 * group.within_1_25,
            100.0 * group.within_2,
            100.0 * group.coverage,
            100.0 * group.coverage_below_85,
            100.0 * group.false_discovery,
            100.0 * group.unexplained,
            100.0 * group.made_worse,
        )?;
    }
    Ok(())
}

//! `north bench experiment`: the runs that a diagnosis proposes are made, and whether the answer is unique then.

use std::io::Write;

use clap::Args;
use north::campaign::Campaign;
use north::diagnose::{Diagnosis, Experiment, Options, diagnose};
use north::failure::Failure;
use north::interrupt;
use north::progress;
use north::settings_file::declare_noise;
use north_finder::settings::Settings;
use serde::Serialize;

use super::Bench;
use crate::hidden::{Campaign as Generated, Family, Group, Proposed};
use crate::judge::{Attribution, consult, judge, write};

/// The next experiment, made: campaigns that cannot tell their effect from others, and what they tell with the proposed runs
///
/// Campaigns are drawn as in "north bench diagnose". Where a diagnosis names confounded alternatives and proposes runs, the same
/// instrument makes these runs, and all runs are diagnosed together; where runs are proposed then, these are made, too, once. The answer
/// is unique where no run at this latitude would tell more; it is right where the hidden effect is what was named, or among what no
/// run tells from it.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench experiment --campaigns 10 --verbose")]
pub struct ExperimentBench {
    /// Campaigns of each family, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only these families, with commas between them; else all with names
    #[arg(long, value_name = "NAME", value_parser = super::diagnose::family, value_delimiter = ',')]
    family: Vec<Family>,
    /// Print what was named before and after for each campaign
    #[arg(long)]
    verbose: bool,
}

/// Added to the seed of the runs that are proposed second.
const SECOND: u64 = 1 << 40;

/// One family, or all together.
#[derive(Serialize, Default)]
pub struct Row {
    family: &'static str,
    campaigns: u64,
    /// Diagnoses that name confounded alternatives.
    confounded: u64,
    /// Of those: no run at this latitude would tell more.
    inseparable: u64,
    /// Of the confounded: with proposed runs that are to tell models apart.
    proposed: u64,
    /// Of those: the answer is unique with the runs.
    unique: u64,
    /// Of the proposed: the answer is unique with the runs, or with those that are proposed then.
    unique_then: u64,
    /// Of those: and right.
    right: u64,
}

impl Bench for ExperimentBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let chosen = |family: &Family| {
            if self.family.is_empty() { family.group() == Group::Named } else { self.family.contains(family) }
        };
        let families: Vec<Family> = Family::all().into_iter().filter(chosen).collect();
        let bar = progress::bar(families.len() as u64 * self.campaigns, "campaigns");
        let mut rows = Vec::new();
        for family in families {
            let mut row = Row { family: family.name(), ..Row::default() };
            for number in 0..self.campaigns {
                self.one(family, number, &mut row, out)?;
                bar.inc(1);
                if interrupt::requested() {
                    return Err(Failure::Interrupted);
                }
            }
            rows.push(row);
        }
        bar.finish_and_clear();
        let sum = |of: fn(&Row) -> u64| rows.iter().map(of).sum::<u64>();
        let all = Row {
            family: "all",
            campaigns: sum(|row| row.campaigns),
            confounded: sum(|row| row.confounded),
            inseparable: sum(|row| row.inseparable),
            proposed: sum(|row| row.proposed),
            unique: sum(|row| row.unique),
            unique_then: sum(|row| row.unique_then),
            right: sum(|row| row.right),
        };
        rows.push(all);
        writeln!(
            out,
            "| family | campaigns | confounded | no run tells more | with proposed runs | unique with them | share, % | unique with those \
             proposed then | share, % | and right |"
        )?;
        writeln!(out, "|---|---|---|---|---|---|---|---|---|---|")?;
        for row in rows.iter().filter(|row| row.confounded > 0 || row.family == "all") {
            let share = |unique: u64| match row.proposed {
                0 => "–".into(),
                proposed => format!("{:.0}", 100.0 * unique as f64 / proposed as f64),
            };
            let Row { family, campaigns, confounded, inseparable, proposed, unique, unique_then, right } = row;
            writeln!(
                out,
                "| {family} | {campaigns} | {confounded} | {inseparable} | {proposed} | {unique} | {} | {unique_then} | {} | {right} |",
                share(*unique),
                share(*unique_then)
            )?;
        }
        Ok(rows)
    }
}

impl ExperimentBench {
    fn one(&self, family: Family, number: u64, row: &mut Row, out: &mut dyn Write) -> Result<(), Failure> {
        let place = Family::all().iter().position(|each| *each == family).unwrap_or_default() as u64;
        let generated = Generated::draw(family, self.seed, (place << 32) + number);
        row.campaigns += 1;
        let Ok(before) = diagnosed(&generated)? else { return Ok(()) };
        if before.effects.iter().all(|effect| effect.ambiguous_with.is_empty()) {
            return Ok(());
        }
        row.confounded += 1;
        let Some(experiment) = to_tell_apart(&before) else {
            row.inseparable += 1;
            if self.verbose {
                writeln!(out, "{} {number}: {} No run tells more.", family.name(), before.verdict)?;
            }
            return Ok(());
        };
        row.proposed += 1;
        if self.verbose {
            writeln!(out, "{} {number}: {}", family.name(), before.verdict)?;
            writeln!(out, "    proposed: {}", experiment.description)?;
        }
        let mut followed = generated.followed_by(&proposed(experiment), self.seed + number);
        let mut after = diagnosed(&followed)?;
        row.unique += u64::from(is_unique(&after));
        if let Some(next) = after.as_ref().ok().and_then(to_tell_apart) {
            if self.verbose {
                writeln!(out, "    still confounded; proposed then: {}", next.description)?;
            }
            followed = followed.followed_by(&proposed(next), self.seed + number + SECOND);
            after = diagnosed(&followed)?;
        }
        let unique = is_unique(&after);
        let verdict = judge(&followed, number, &after, &consult(&followed, &settings(&followed)));
        let right = matches!(verdict.attribution, Attribution::Right | Attribution::Ambiguous);
        row.unique_then += u64::from(unique);
        row.right += u64::from(unique && right);
        if self.verbose {
            let then = after.map_or_else(|refusal| refusal, |after| after.verdict);
            let told = if unique { "unique" } else { "still confounded" };
            let named = if right { "right" } else { "wrong" };
            writeln!(out, "    hidden: {}", verdict.hidden)?;
            writeln!(out, "    {told}, {named}: {then}")?;
        }
        Ok(())
    }
}

/// Whether something was found that no run at this latitude would tell more of.
fn is_unique(after: &Result<Diagnosis, String>) -> bool {
    after.as_ref().is_ok_and(|after| to_tell_apart(after).is_none() && !after.effects.is_empty())
}

/// The runs that an experiment asks for.
fn proposed(experiment: &Experiment) -> Proposed {
    Proposed {
        order_deg: experiment.order_deg.clone(),
        headings_deg: experiment.headings_deg.clone(),
        dwell_s: experiment.dwell_s as usize,
        warm_up_s: experiment.warm_up_s as usize,
        lean_deg: [experiment.pitch_deg, experiment.roll_deg],
    }
}

/// The experiment that is to tell models apart, where there is one.
fn to_tell_apart(diagnosis: &Diagnosis) -> Option<&Experiment> {
    diagnosis.next_experiment.as_ref().filter(|each| !each.separates.is_empty())
}

fn settings(generated: &Generated) -> Settings {
    let mut settings = Settings::default();
    declare_noise(&mut settings, generated.arw_deg_per_sqrt_h);
    settings
}

/// A diagnosis of what was generated, or why there is none.
fn diagnosed(generated: &Generated) -> Result<Result<Diagnosis, String>, Failure> {
    let folder = tempfile::tempdir()?;
    let campaign: Campaign = write(generated, folder.path())?;
    let options = Options { settings: settings(generated), ..Options::default() };
    Ok(diagnose(&campaign, &options).map_err(|refusal| refusal.to_string()))
}

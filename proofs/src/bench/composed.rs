//! `north bench diagnose --group composed`: the diagnosis against effects composed at random.

use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use north::failure::Failure;
use north::{interrupt, progress};
use serde::Serialize;

use super::compose::Kinds;
use crate::composed::judge::{Azimuths, Verdict, judge};
use crate::composed::{Campaign, Kind};
use crate::statistics::{median, probability_interval, ratio_interval};

/// Which campaigns are judged.
pub(super) struct Judged<'a> {
    pub(super) numbers: Range<u64>,
    pub(super) seed: u64,
    pub(super) kinds: Kinds,
    /// Folders of campaigns that were written before, in place of new ones.
    pub(super) dir: Option<&'a Path>,
    pub(super) verbose: bool,
}

/// One line of a table: campaigns of a kind, all or those with an effect at one port.
#[derive(Serialize)]
pub struct Line {
    kind: Kind,
    port: String,
    campaigns: usize,
    /// Campaigns without a diagnosis, or without azimuths by the model that was written.
    refused: usize,
    model: Shares,
    reported: Shares,
    /// Share of campaigns, 0 to 1.
    unexplained: f64,
    /// Campaigns in which something was named.
    named: usize,
}

/// How azimuths compare with the oracle's; a campaign without them counts as worse than any.
#[derive(Serialize)]
pub struct Shares {
    over_oracle_median: f64,
    within_1_25: f64,
    within_2: f64,
    /// Of the campaigns with azimuths.
    check_runs: usize,
    covered: usize,
    /// 95 % interval of the probability of it.
    covered_low: f64,
    covered_high: f64,
    /// Of all check runs together, each in units of its campaign's oracle.
    sigma_over_error: f64,
    /// Share of campaigns whose rms grew by more than 5 %, or that have no azimuths.
    made_worse: f64,
}

/// Growth of the rms from which on a campaign is made worse.
const WORSE_BY: f64 = 1.05;

impl Shares {
    fn of(verdicts: &[&Verdict], which: impl Fn(&Verdict) -> Option<&Azimuths>) -> Self {
        let ratios: Vec<f64> = verdicts.iter().map(|verdict| verdict.ratio(which(verdict))).collect();
        let share = |is: &dyn Fn(usize) -> bool| {
            (0..verdicts.len()).filter(|&at| is(at)).count() as f64 / verdicts.len() as f64
        };
        let told = || verdicts.iter().filter_map(|verdict| Some((verdict.oracle_deg, which(verdict)?)));
        let [check_runs, covered] =
            told().fold([0; 2], |[runs, covered], (_, one)| [runs + one.errors_deg.len(), covered + one.covered]);
        let squares = |of: fn(&Azimuths) -> &Vec<f64>| -> f64 {
            told().flat_map(|(oracle_deg, one)| of(one).iter().map(move |value| (value / oracle_deg).powi(2))).sum()
        };
        let of_campaigns: Vec<[f64; 2]> =
            told().map(|(_, one)| [one.covered as f64, one.errors_deg.len() as f64]).collect();
        let [covered_low, covered_high] = coverage_interval(covered, check_runs, &of_campaigns);
        Self {
            over_oracle_median: median(ratios.clone()),
            within_1_25: share(&|at| ratios[at] <= 1.25),
            within_2: share(&|at| ratios[at] <= 2.0),
            check_runs,
            covered,
            covered_low,
            covered_high,
            sigma_over_error: (squares(|one| &one.sigmas_deg) / squares(|one| &one.errors_deg)).sqrt(),
            made_worse: share(&|at| {
                which(verdicts[at]).is_none_or(|one| one.rms_deg > WORSE_BY * verdicts[at].before_deg)
            }),
        }
    }
}

/// The wider of two intervals: the exact one of independent check runs, and the bootstrap over the campaigns, the runs of each of which share a model. The
/// bootstrap has no width where all runs are covered.
fn coverage_interval(covered: usize, check_runs: usize, of_campaigns: &[[f64; 2]]) -> [f64; 2] {
    let ([low, high], [lowest, highest]) = (probability_interval(covered, check_runs), ratio_interval(of_campaigns));
    [low.min(lowest), high.max(highest)]
}

impl Line {
    fn of(kind: Kind, port: &str, verdicts: &[&Verdict]) -> Self {
        let count = |is: &dyn Fn(&Verdict) -> bool| verdicts.iter().filter(|verdict| is(verdict)).count();
        Self {
            kind,
            port: port.to_owned(),
            campaigns: verdicts.len(),
            refused: count(&|verdict| verdict.refusal.is_some()),
            model: Shares::of(verdicts, |verdict| verdict.model.as_ref()),
            reported: Shares::of(verdicts, |verdict| verdict.reported.as_ref()),
            unexplained: count(&|verdict| verdict.unexplained) as f64 / verdicts.len() as f64,
            named: count(&|verdict| !verdict.found.is_empty()),
        }
    }
}

/// Judges the campaigns and prints the tables: lines of them together, and each campaign.
pub(super) fn measure(judged: &Judged<'_>, out: &mut dyn Write) -> Result<(Vec<Line>, Vec<Verdict>), Failure> {
    let bar = progress::bar(judged.numbers.end - judged.numbers.start, "campaigns");
    let mut verdicts = Vec::new();
    // One after the other: a diagnosis uses all cores by itself.
    for number in judged.numbers.clone() {
        let temporary = tempfile::tempdir()?;
        let folder = match judged.dir {
            Some(dir) => dir.join(format!("{number:04}")),
            None => {
                let (seed, kind) = (judged.seed, judged.kinds.of(number));
                let folder = temporary.path().join("campaign");
                let target = folder.clone();
                progress::interruptible(move || Campaign::draw(seed, number, kind).write(&target), || ())??;
                folder
            }
        };
        if judged.dir.is_some() && !folder.is_dir() {
            break;
        }
        let verdict = progress::interruptible(move || judge(&folder, number), || ())??;
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        if judged.verbose {
            write_verdict(out, &verdict)?;
        }
        verdicts.push(verdict);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let (Some(dir), []) = (judged.dir, verdicts.as_slice()) {
        return Err(Failure::Usage(format!(
            "{}: there is no campaign {:04} in it",
            dir.display(),
            judged.numbers.start
        )));
    }
    let mut lines = Vec::new();
    for kind in [Kind::Inside, Kind::Outside, Kind::Empty] {
        for port in ["all", "adds", "scales", "turns", "tilts"] {
            let is = |verdict: &&Verdict| {
                verdict.kind == kind && (port == "all" || verdict.ports.iter().any(|at| at == port))
            };
            let of: Vec<&Verdict> = verdicts.iter().filter(is).collect();
            if !of.is_empty() {
                lines.push(Line::of(kind, port, &of));
            }
        }
    }
    write_lines(out, &lines)?;
    write_campaigns(out, &verdicts)?;
    Ok((lines, verdicts))
}

/// The campaigns, those with the smallest errors over the oracle's first; a campaign without azimuths stands last.
fn write_campaigns(out: &mut dyn Write, verdicts: &[Verdict]) -> io::Result<()> {
    let mut sorted: Vec<&Verdict> = verdicts.iter().collect();
    sorted.sort_by(|a, b| a.over_oracle().total_cmp(&b.over_oracle()));
    writeln!(
        out,
        "\nEach campaign, by the written model:\n\n| campaign | hidden | rms before, ° | after, ° | oracle, ° | after / oracle | covered \
         | found |\n|---|---|---|---|---|---|---|---|"
    )?;
    for verdict in sorted {
        writeln!(
            out,
            "| {} | `{}` | {:.4} | {} | {:.4} | {:.2} | {} | {} |",
            verdict.campaign,
            verdict.hidden(),
            verdict.before_deg,
            verdict.model.as_ref().map_or("–".into(), |model| format!("{:.4}", model.rms_deg)),
            verdict.oracle_deg,
            verdict.over_oracle(),
            verdict.covered(),
            verdict.what_was_found(),
        )?;
    }
    Ok(())
}

fn write_lines(out: &mut dyn Write, lines: &[Line]) -> io::Result<()> {
    for (title, which) in [("By the written model", 0), ("As reported", 1)] {
        writeln!(
            out,
            "\n{title}:\n\n| kind | port | campaigns | refused | rms / oracle, median | ≤ 1.25, % | ≤ 2, % | covered, % (95 %) \
             | sigma / error | made worse, % | unexplained, % | something named |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
        )?;
        for line in lines {
            let shares = if which == 0 { &line.model } else { &line.reported };
            writeln!(
                out,
                "| {:?} | {} | {} | {} | {:.2} | {:.0} | {:.0} | {:.1} ({:.1} … {:.1}) | {:.2} | {:.1} | {:.1} | {} |",
                line.kind,
                line.port,
                line.campaigns,
                line.refused,
                shares.over_oracle_median,
                100.0 * shares.within_1_25,
                100.0 * shares.within_2,
                100.0 * shares.covered as f64 / shares.check_runs as f64,
                100.0 * shares.covered_low,
                100.0 * shares.covered_high,
                shares.sigma_over_error,
                100.0 * shares.made_worse,
                100.0 * line.unexplained,
                line.named,
            )?;
        }
    }
    Ok(())
}

fn write_verdict(out: &mut dyn Write, verdict: &Verdict) -> io::Result<()> {
    let rms = |azimuths: &Option<Azimuths>| azimuths.as_ref().map_or(f64::NAN, |one| one.rms_deg);
    writeln!(
        out,
        "{:04} {:?} {}: before {:.4}, by the model {:.4}, reported {:.4}, oracle {:.4}, ratio {:.2}, covered {}; found {}",
        verdict.campaign,
        verdict.kind,
        verdict.hidden(),
        verdict.before_deg,
        rms(&verdict.model),
        rms(&verdict.reported),
        verdict.oracle_deg,
        verdict.over_oracle(),
        verdict.covered(),
        verdict.what_was_found(),
    )?;
    verdict.composition.iter().try_for_each(|words| writeln!(out, "    {words}"))?;
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six covered runs of twelve, by campaigns all or none: any share. All of them: Clopper and Pearson's 0.025^(1/12).
    #[test]
    fn runs_of_a_campaign_are_not_independent() {
        assert_eq!(coverage_interval(6, 12, &[[6.0, 6.0], [0.0, 6.0]]), [0.0, 1.0]);
        let [low, high] = coverage_interval(12, 12, &[[6.0, 6.0], [6.0, 6.0]]);
        assert!((low - 0.025f64.powf(1.0 / 12.0)).abs() < 1e-4 && high == 1.0);
        assert_eq!(coverage_interval(0, 0, &[]), [0.0, 1.0]);
    }
}

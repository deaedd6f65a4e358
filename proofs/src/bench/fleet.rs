//! `north bench fleet`: what a fleet's prior is worth for the next unit, and whether units that are not like the others are seen.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use learn::Family;
use north::campaign::{Campaign as Recorded, Role};
use north::diagnose::{Diagnosis, Options, diagnose};
use north::failure::Failure;
use north::fleet::{self, Fleet as Learned, sources};
use north::settings_file::campaign_settings;
use north::{interrupt, progress};
use north_finder::units::wrap_180_deg;
use serde::Serialize;

use super::Bench;
use crate::composed::{Campaign, Fleet, Kind, UnitKind};
use crate::statistics::{MISSING_DEG, rms};

/// Fleets of simulated instruments: azimuths with few runs and the fleet's prior, and units that are out of the family
///
/// Every type has effects that are composed at random of the grammar; from unit to unit their weights spread by a tenth to a third. A prior is learned from
/// --units units with --runs runs each. Then new units of the type, and such that are not like the others (an effect of the other sign or several times as
/// large, an effect more), are diagnosed with sixteen runs, with four, and with four and the prior; judged are the true azimuths of eight more runs of each.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench fleet --types 1 --units 20 --tests 4")]
pub struct FleetBench {
    /// Types of instruments
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(0..=1000))]
    types: u64,
    /// Units that the prior is learned from
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(2..=1000))]
    units: u64,
    /// Runs of each of these
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(4..=64))]
    runs: u64,
    /// New units of each type, and as many that are not like the others
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=1000))]
    tests: u64,
    /// Types without any effect, in which nothing may be found
    #[arg(long, value_name = "N", default_value_t = 1)]
    empty: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder to keep every type's campaigns and what was learned of them in
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

/// One type.
#[derive(Serialize)]
pub struct Row {
    #[serde(rename = "type")]
    number: u64,
    hidden: Vec<String>,
    spread: f64,
    /// What the units have in common, as it was learned.
    learned: Vec<String>,
    /// Azimuth error of the new units, root mean square, degrees: before, sixteen runs, four runs, four runs with the prior.
    before_deg: f64,
    sixteen_runs_deg: f64,
    four_runs_deg: f64,
    four_runs_with_prior_deg: f64,
    /// The same of units that are not like the others: with four runs, and with the prior.
    outside_four_runs_deg: f64,
    outside_with_prior_deg: f64,
    /// Probability that a unit out of the family has a greater probability of it than one in it: with four runs and the prior.
    roc: f64,
    /// Probabilities of being outside: of units like the others, and of the others.
    usual: Vec<f64>,
    outside: Vec<f64>,
    seconds: f64,
}

/// Runs of a new unit that may be learned from, those of them in the short campaign, and those that are judged.
const LONG: usize = 16;
const SHORT: usize = 4;
const JUDGED: usize = 8;
/// How much worse a unit out of the family may be with the prior than without.
const PULLED: f64 = 1.1;
const LEAST_ROC: f64 = 0.95;

/// Errors of one unit, degrees, by arm.
#[derive(Default)]
struct Errors {
    before: Vec<f64>,
    long: Vec<f64>,
    short: Vec<f64>,
    informed: Vec<f64>,
    outside: f64,
}

impl Bench for FleetBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        if self.types + self.empty == 0 {
            return Err(Failure::Usage("there is no type: --types or --empty is at least 1".to_owned()));
        }
        let bar = progress::bar((self.types + self.empty) * (2 * self.units + 2 * self.tests), "units");
        let mut rows = Vec::new();
        for number in 0..self.types + self.empty {
            let kind = if number < self.types { Kind::Inside } else { Kind::Empty };
            rows.push(self.one(number, kind, &bar)?);
            print(out, &rows, rows.len() - 1)?;
        }
        bar.finish_and_clear();
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let hidden: Vec<&Row> = rows.iter().filter(|row| !row.hidden.is_empty()).collect();
        let total = |of: fn(&Row) -> f64| hidden.iter().map(|row| of(row).powi(2)).sum::<f64>().sqrt();
        let mut missed = Vec::new();
        if !(total(|row| row.four_runs_with_prior_deg) <= total(|row| row.sixteen_runs_deg)) {
            missed.push("four runs with the prior are worse than sixteen without".to_owned());
        }
        if !(total(|row| row.outside_with_prior_deg) <= PULLED * total(|row| row.outside_four_runs_deg)) {
            missed.push("units out of the family are pulled to it".to_owned());
        }
        let roc = hidden.iter().map(|row| row.roc).sum::<f64>() / hidden.len().max(1) as f64;
        if !hidden.is_empty() && !(roc >= LEAST_ROC) {
            missed.push(format!("the area under the ROC of units out of the family is {roc:.3}"));
        }
        if rows.iter().any(|row| row.hidden.is_empty() && !row.learned.is_empty()) {
            missed.push("a fleet without effects has some".to_owned());
        }
        if missed.is_empty() { Ok(()) } else { Err(Failure::Refused(missed.join("; "))) }
    }
}

impl FleetBench {
    fn one(&self, number: u64, kind: Kind, bar: &indicatif::ProgressBar) -> Result<Row, Failure> {
        let begun = std::time::Instant::now();
        let fleet = Fleet::draw(self.seed, number, kind);
        let passing = tempfile::tempdir()?;
        let folder = match &self.keep {
            Some(keep) => keep.join(format!("type-{number}")),
            None => passing.path().to_owned(),
        };
        for unit in 0..self.units {
            let campaign = fleet.unit(unit, self.runs as usize, 0, UnitKind::Usual);
            campaign.write(&folder.join("learned").join(format!("{unit:04}")))?;
        }
        let units = sources(&[folder.join("learned")])?;
        let learned = fleet::learn(&units, fleet::cores(), interrupt::flag(), || bar.inc(1))?;
        learned.write(&folder.join("fleet.toml"))?;
        let mut usual = Vec::new();
        let mut odd = Vec::new();
        for test in 0..if kind == Kind::Empty { 0 } else { self.tests } {
            let own = if test % 2 == 0 { UnitKind::OwnWeight } else { UnitKind::OwnEffect };
            let unit = fleet.unit(10_000 + test, LONG, JUDGED, UnitKind::Usual);
            usual.push(errors(&unit, &folder.join(format!("usual-{test}")), &learned, true)?);
            let unit = fleet.unit(20_000 + test, LONG, JUDGED, own);
            odd.push(errors(&unit, &folder.join(format!("outside-{test}")), &learned, false)?);
            bar.inc(2);
        }
        let outside = |units: &[Errors]| units.iter().map(|unit| unit.outside).collect::<Vec<f64>>();
        Ok(Row {
            number,
            hidden: fleet.names(),
            spread: fleet.spread,
            learned: learned.effects.iter().map(|effect| format!("{} ({:.2})", effect.name, effect.share)).collect(),
            before_deg: rms_of(&usual, |unit| &unit.before),
            sixteen_runs_deg: rms_of(&usual, |unit| &unit.long),
            four_runs_deg: rms_of(&usual, |unit| &unit.short),
            four_runs_with_prior_deg: rms_of(&usual, |unit| &unit.informed),
            outside_four_runs_deg: rms_of(&odd, |unit| &unit.short),
            outside_with_prior_deg: rms_of(&odd, |unit| &unit.informed),
            roc: roc(&outside(&usual), &outside(&odd)),
            usual: outside(&usual),
            outside: outside(&odd),
            seconds: begun.elapsed().as_secs_f64(),
        })
    }
}

/// The true errors of one unit's judged runs by every arm, of the same runs by all, its campaign written to a folder; the long one only where it is wanted.
fn errors(unit: &Campaign, path: &Path, learned: &Learned, long: bool) -> Result<Errors, Failure> {
    unit.write(path)?;
    let of = |fits: usize, family: Family| -> Result<(Vec<f64>, Vec<f64>, Diagnosis), Failure> {
        let diagnosis = shortened(path, fits, family)?;
        let truth = unit.truth();
        let miss = |of: fn(&north::diagnose::RunDiagnosis) -> Option<f64>| -> Vec<f64> {
            let found = |file: &str| diagnosis.runs.iter().find(|run| run.file == file).and_then(of);
            let checks = truth.runs.iter().filter(|own| own.role == "check");
            checks
                .map(|own| found(&own.file).map_or(MISSING_DEG, |deg| wrap_180_deg(deg - own.true_azimuth_deg)))
                .collect()
        };
        Ok((miss(|run| run.azimuth_before_deg), miss(|run| run.azimuth_after_deg), diagnosis))
    };
    let mut errors = Errors::default();
    if long {
        (errors.before, errors.long, _) = of(LONG, Family::default())?;
    }
    (_, errors.short, _) = of(SHORT, Family::default())?;
    let (_, informed, diagnosis) = of(SHORT, learned.family())?;
    errors.informed = informed;
    errors.outside = diagnosis.family.map_or(0.0, |family| family.outside);
    Ok(errors)
}

/// A diagnosis of the first runs that may be learned from, and all that are judged.
fn shortened(path: &Path, fits: usize, family: Family) -> Result<Diagnosis, Failure> {
    let mut campaign = Recorded::read(path)?;
    let mut left = fits;
    campaign.runs.retain(|run| {
        let taken = run.role == Role::Check || left > 0;
        left -= usize::from(run.role == Role::Fit && left > 0);
        taken
    });
    let settings = campaign_settings(&campaign, None)?;
    let options = Options { settings, family, ..Options::default() };
    diagnose(&campaign, &options).map_err(|refusal| Failure::Refused(refusal.to_string()))
}

/// Root mean square of errors of all units; not a number where none was judged, as in a fleet without effects.
fn rms_of(units: &[Errors], of: impl Fn(&Errors) -> &Vec<f64>) -> f64 {
    rms(units.iter().flat_map(of).copied())
}

/// Area under the ROC: the share of pairs in the right order, a tie half of one; not a number where there are none.
fn roc(inside: &[f64], outside: &[f64]) -> f64 {
    let pair = |(a, b): (&f64, &f64)| {
        if b > a {
            1.0
        } else if b == a {
            0.5
        } else {
            0.0
        }
    };
    let pairs = inside.iter().flat_map(|a| outside.iter().map(move |b| (a, b)));
    pairs.map(pair).sum::<f64>() / (inside.len() * outside.len()) as f64
}

/// The line of one type, below a head before the first.
fn print(out: &mut dyn Write, rows: &[Row], at: usize) -> std::io::Result<()> {
    if at == 0 {
        writeln!(
            out,
            "| type | hidden | spread | learned (share) | before, ° rms | 16 runs | 4 runs | 4 runs, prior | outside: 4 runs | with prior | ROC | s |"
        )?;
        writeln!(out, "|---|---|---|---|---|---|---|---|---|---|---|---|")?;
    }
    let row = &rows[at];
    let judged = |value: f64| if value.is_nan() { "–".into() } else { format!("{value:.4}") };
    writeln!(
        out,
        "| {} | {} | {:.2} | {} | {} | {} | {} | {} | {} | {} | {} | {:.0} |",
        row.number,
        row.hidden.join(" + "),
        row.spread,
        row.learned.join(" + "),
        judged(row.before_deg),
        judged(row.sixteen_runs_deg),
        judged(row.four_runs_deg),
        judged(row.four_runs_with_prior_deg),
        judged(row.outside_four_runs_deg),
        judged(row.outside_with_prior_deg),
        judged(row.roc),
        row.seconds
    )?;
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_by_hand() {
        // Of six pairs four are in order and one is a tie.
        assert_eq!(roc(&[0.1, 0.4, 0.6], &[0.4, 0.7]), 4.5 / 6.0);
        assert_eq!(roc(&[0.1], &[0.9]), 1.0);
    }
}

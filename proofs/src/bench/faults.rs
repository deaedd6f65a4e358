//! `north bench faults`: the fault campaign.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use north::engine::qemu::image;
use north::failure::Failure;
use north::progress;
use north_finder::health::Fault;
use serde::Serialize;

use super::orders::is_warned;
use super::{Bench, trials};
use crate::faults::{Ending, Kind, Outcome, Trial};

/// Errors beyond this many sigmas are wrong.
const WRONG_SIGMAS: f64 = 4.0;
/// Trials that are shown of each promise that is broken.
const SHOWN: usize = 12;

/// One to three random faults anywhere in the instrument, in every order, at latitudes to 85 degrees
///
/// Gyro and its bytes, sensors, motor, encoder, base, flash, power, settings, commands at the wrong time. The firmware's
/// state machine runs in this process; a sample of the trials also in its image, in QEMU, where all must end as they did here. Exit code 1 after a
/// panic, a hang, lost settings, another end in QEMU, or an azimuth beyond 4 sigma without a warning that is so without the faults that no single fix can see,
/// too. A warning is a flag that says that the azimuth may be wrong; what was waited for, taken out or not reached is none.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north bench faults --json faults.json\n  north bench faults --only 512\n  north bench faults --kind encoder-slip\n  north bench faults --trials 40 --qemu 40"
)]
pub struct Faults {
    /// Trials, 1 to 10000000
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only the trial with this number, in full
    #[arg(long, value_name = "N")]
    only: Option<u64>,
    /// Only the trials in which this kind of fault takes part
    #[arg(long, value_name = "NAME")]
    kind: Option<String>,
    /// Run the first N of the trials in the firmware image, in QEMU, as well
    #[arg(long, value_name = "N")]
    qemu: Option<usize>,
}

/// What became of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Survived,
    Recovered,
    Flagged,
    RefusedRightly,
    RefusedOtherwise,
    WrongFlagged,
    WrongUnseeable,
    Wrong,
    Hang,
    Panic,
}

/// One kind of fault: the trials that it took part in, alone or with others.
#[derive(Default, Serialize)]
pub struct Row {
    kind: &'static str,
    trials: usize,
    /// Azimuth within 4 sigma without a warning; the same after a fix that was begun again; the same with a warning.
    survived: usize,
    recovered: usize,
    flagged: usize,
    /// For a reason that one of the faults gives; for another.
    refused_rightly: usize,
    refused_otherwise: usize,
    /// Beyond 4 sigma: with a warning; without one, and not so without the faults that no single fix can see; without one.
    wrong_flagged: usize,
    wrong_unseeable: usize,
    wrong: usize,
    hangs: usize,
    panics: usize,
    settings_lost: usize,
    /// Refusals by fault.
    refusals: BTreeMap<&'static str, usize>,
    /// Trials that ran in QEMU too, and those of them that ended there in the same way, with all digits.
    in_qemu: usize,
    same_in_qemu: usize,
}

impl Verdict {
    fn of(trial: &Trial, outcome: &Outcome) -> Self {
        match outcome.ending {
            Ending::Panic => Self::Panic,
            Ending::Hang => Self::Hang,
            Ending::Refused(fault) if is_right(trial, fault) => Self::RefusedRightly,
            Ending::Refused(_) => Self::RefusedOtherwise,
            Ending::Azimuth { fix, error_deg } => {
                let wrong = !(error_deg.abs() <= WRONG_SIGMAS * fix.sigma_deg);
                match (wrong, is_warned(&fix)) {
                    (false, false) if outcome.restarted => Self::Recovered,
                    (false, false) => Self::Survived,
                    (false, true) => Self::Flagged,
                    (true, true) => Self::WrongFlagged,
                    (true, false) if trial.unseeable().next().is_some() => Self::WrongUnseeable,
                    (true, false) => Self::Wrong,
                }
            }
        }
    }
}

/// A trial, how it ended, and what is said of that.
struct Tried {
    number: u64,
    trial: Trial,
    outcome: Outcome,
    verdict: Verdict,
}

impl Tried {
    fn new(seed: u64, number: u64) -> Result<Self, Failure> {
        let trial = Trial::draw(seed, number)?;
        let outcome = trial.run(None)?;
        let mut verdict = Verdict::of(&trial, &outcome);
        if verdict == Verdict::WrongUnseeable {
            // A fault that cannot be seen excuses no other one.
            let twin = Trial::draw_seeable(seed, number)?;
            if Verdict::of(&twin, &twin.run(None)?) == Verdict::Wrong {
                verdict = Verdict::Wrong;
            }
        }
        Ok(Self { number, trial, outcome, verdict })
    }
}

fn is_right(trial: &Trial, fault: Fault) -> bool {
    // Rates that no azimuth explains: the reason says more than that where the Earth's rate is not in them, or another one.
    let general = if matches!(fault, Fault::NoEarthRate | Fault::NotEarthRate) { Fault::Unsolvable } else { fault };
    trial.kinds.iter().any(|kind| kind.refusals.contains(&fault) || kind.refusals.contains(&general))
}

impl Row {
    fn add(&mut self, verdict: Verdict, outcome: &Outcome) {
        self.trials += 1;
        *match verdict {
            Verdict::Survived => &mut self.survived,
            Verdict::Recovered => &mut self.recovered,
            Verdict::Flagged => &mut self.flagged,
            Verdict::RefusedRightly => &mut self.refused_rightly,
            Verdict::RefusedOtherwise => &mut self.refused_otherwise,
            Verdict::WrongFlagged => &mut self.wrong_flagged,
            Verdict::WrongUnseeable => &mut self.wrong_unseeable,
            Verdict::Wrong => &mut self.wrong,
            Verdict::Hang => &mut self.hangs,
            Verdict::Panic => &mut self.panics,
        } += 1;
        self.settings_lost += usize::from(outcome.settings_lost);
        if let Ending::Refused(fault) = outcome.ending {
            *self.refusals.entry(fault.name()).or_default() += 1;
        }
    }
}

impl Bench for Faults {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let mut numbers: Vec<u64> = self.only.map_or(0..self.trials, |only| only..only + 1).collect();
        if let Some(name) = &self.kind {
            if !Kind::all().any(|kind| kind.name == name) {
                return Err(Failure::Refused(format!("no kind of fault is called {name}")));
            }
            let drawn = numbers.into_iter().map(|number| Ok((number, Trial::draw(self.seed, number)?)));
            let drawn = drawn.collect::<Result<Vec<_>, Failure>>()?.into_iter();
            let wanted = drawn.filter(|(_, trial)| trial.kinds.iter().any(|kind| kind.name == name));
            numbers = wanted.map(|(number, _)| number).collect();
        }
        let bar = progress::bar(numbers.len() as u64, "trials");
        let all = trials(numbers, &bar, |number| Tried::new(self.seed, number))?;
        bar.finish_and_clear();
        let all = all.into_iter().collect::<Result<Vec<_>, Failure>>()?;
        let mut total = Row { kind: "all", ..Row::default() };
        let mut rows: Vec<Row> = Kind::all().map(|kind| Row { kind: kind.name, ..Row::default() }).collect();
        for Tried { trial, outcome, verdict, .. } in &all {
            total.add(*verdict, outcome);
            for row in rows.iter_mut().filter(|row| trial.kinds.iter().any(|kind| kind.name == row.kind)) {
                row.add(*verdict, outcome);
            }
        }
        if let Some(count) = self.qemu {
            let image = image::build(image::Board::Mps2)?;
            try_in_qemu(&image, all.get(..count).unwrap_or(&all), &mut total, out)?;
        }
        rows.push(total);
        write_rows(out, &rows)?;
        write_broken(out, &all, self.only.is_some())?;
        if let Some(all) = rows.last().filter(|all| all.in_qemu > 0) {
            writeln!(out, "in QEMU: {} of {} ended in the same way, with all digits", all.same_in_qemu, all.in_qemu)?;
        }
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let Some(all) = rows.iter().find(|row| row.kind == "all") else { return Ok(()) };
        let broken: Vec<String> = [
            ("wrong beyond 4 sigma without a warning", all.wrong),
            ("no end in time", all.hangs),
            ("panics", all.panics),
            ("settings lost", all.settings_lost),
            ("ended otherwise in QEMU", all.in_qemu - all.same_in_qemu),
        ]
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(what, count)| format!("{what}: {count} of {}", all.trials))
        .collect();
        if broken.is_empty() { Ok(()) } else { Err(Failure::Refused(broken.join("\nnorth: "))) }
    }
}

/// Runs the trials in the firmware image, in QEMU, and counts those that end there in the same way.
fn try_in_qemu(image: &Path, sample: &[Tried], total: &mut Row, out: &mut dyn Write) -> Result<(), Failure> {
    let bar = progress::bar(sample.len() as u64, "trials in QEMU");
    let there = trials(0..sample.len() as u64, &bar, |place| sample[place as usize].trial.run(Some(image)))?;
    bar.finish_and_clear();
    for (Tried { number, outcome: here, .. }, there) in sample.iter().zip(there) {
        let there = there?;
        total.in_qemu += 1;
        total.same_in_qemu += usize::from(there == *here);
        if there != *here {
            writeln!(out, "trial {number}: in this process {here:?}\n  in QEMU {there:?}")?;
        }
    }
    Ok(())
}

fn write_rows(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "| fault | trials | survived | recovered | flagged | refused rightly | refused otherwise | wrong, flagged \
         | wrong, unseeable | wrong | hang | panic | settings lost |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    rows.iter().try_for_each(|row| {
        writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            row.kind,
            row.trials,
            row.survived,
            row.recovered,
            row.flagged,
            row.refused_rightly,
            row.refused_otherwise,
            row.wrong_flagged,
            row.wrong_unseeable,
            row.wrong,
            row.hangs,
            row.panics,
            row.settings_lost,
        )
    })
}

/// The trials that break a promise, or are refused for a reason that their faults do not give.
fn write_broken(out: &mut dyn Write, all: &[Tried], any: bool) -> io::Result<()> {
    for broken in [Verdict::Wrong, Verdict::Hang, Verdict::Panic, Verdict::RefusedOtherwise] {
        let of_kind = all.iter().filter(|tried| any || tried.verdict == broken);
        for Tried { number, trial, outcome, .. } in of_kind.take(SHOWN) {
            let what = match outcome.ending {
                Ending::Azimuth { fix, error_deg } => format!(
                    "error {error_deg:+.4}°, {:.1} sigma, flags {:?}",
                    error_deg / fix.sigma_deg,
                    fix.flags.iter().map(|flag| flag.name()).collect::<Vec<_>>()
                ),
                Ending::Refused(fault) => fault.name().into(),
                Ending::Hang => "no end in time".into(),
                Ending::Panic => "panic".into(),
            };
            let latitude_deg = trial.scenario.site.latitude_deg;
            writeln!(
                out,
                "{broken:?}: trial {number}, {}, latitude {latitude_deg:.1}°, {:?}: {what}",
                trial.order, trial.kinds
            )?;
        }
        if any {
            break;
        }
    }
    Ok(())
}

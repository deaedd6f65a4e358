//! `north watch`: does the error model still hold?

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::failure::Failure;
use crate::output::JsonOption;
use crate::service::{ALARM, BASELINE, Cause, Change, Kind, Log, Watch as Verdict, signals, watch};

/// Watch the log of an instrument's fixes: does its error model still hold, what moved, by how much, since when
///
/// The first hundred fixes say what is normal. False alarms are a thousand fixes apart on average, or more. Exit code 1 where the model does not hold.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north solve year-2026 --log unit-7.csv && north watch unit-7.csv
  north watch unit-7-2025.csv unit-7-2026.csv --json -")]
pub struct Watch {
    /// Logs of one instrument, in the order of time
    #[arg(value_name = "LOG.csv", required = true)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

#[derive(Serialize)]
struct Said<'a> {
    fixes: usize,
    holds: bool,
    signals: Vec<Kind>,
    /// Number of the fix with which the alarm came.
    alarm_fix: Option<u64>,
    /// Number and time of the first changed fix, for every change.
    since: Vec<Since<'a>>,
    #[serde(flatten)]
    verdict: &'a Verdict,
}

#[derive(Serialize)]
struct Since<'a> {
    fix: u64,
    utc: &'a str,
}

impl Watch {
    pub fn run(self) -> Result<(), Failure> {
        crate::output::check([self.json.path()])?;
        let log = Log::read(&self.logs)?;
        let count = log.fixes.len();
        if count <= BASELINE {
            let text = format!(
                "the logs hold {count} fixes; the first {BASELINE} say what is normal, and there are none to watch"
            );
            return Err(Failure::Refused(text));
        }
        let signals = signals(&log.fixes);
        let temperatures_c = log.temperatures_c();
        let verdict = watch(&signals, &log.switched(), temperatures_c.as_deref());
        if verdict.watched == 0 {
            let text = "no signal that every fix has, and that moves: bias_deg_h, amplitude_deg_h, misfit with freedom, azimuth_deg with check_deg";
            return Err(Failure::Refused(text.into()));
        }
        let kinds: Vec<Kind> = signals.iter().map(|signal| signal.kind).collect();
        let out = &mut self.json.human();
        write(out, &log, &kinds, &verdict)?;
        let said = Said {
            fixes: count,
            holds: verdict.alarm.is_none(),
            alarm_fix: verdict.alarm.map(|at| log.fixes[at].fix),
            since: verdict.changes.iter().map(|change| since(&log, change)).collect(),
            signals: kinds,
            verdict: &verdict,
        };
        self.json.write(&said)?;
        match verdict.alarm {
            Some(at) => {
                Err(Failure::Refused(format!("the error model no longer holds: seen with fix {}", log.fixes[at].fix)))
            }
            None => Ok(()),
        }
    }
}

fn since<'a>(log: &'a Log, change: &Change) -> Since<'a> {
    let fix = &log.fixes[change.from];
    Since { fix: fix.fix, utc: &fix.utc }
}

fn write(out: &mut dyn Write, log: &Log, kinds: &[Kind], verdict: &Verdict) -> io::Result<()> {
    let switches = log.switched().iter().filter(|&&switched| switched).count();
    writeln!(
        out,
        "{} fixes, {switches} switch-ons between them; the first {BASELINE} say what is normal",
        log.fixes.len()
    )?;
    writeln!(out, "signals    {}", kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", "))?;
    let most = verdict.statistic.iter().copied().fold(0.0, f64::max);
    let Some(at) = verdict.alarm else {
        writeln!(
            out,
            "holds      {} fixes watched; the statistic was {most:.1} at most, and {ALARM} is an alarm, of which false ones come after {ALARM} fixes \
             on average, or later",
            verdict.watched
        )?;
        return blind(out, kinds);
    };
    writeln!(out, "changed    seen with fix {}, {} fixes after the baseline", log.fixes[at].fix, verdict.watched)?;
    for change in &verdict.changes {
        let Since { fix, utc } = since(log, change);
        let (signal, unit, size, sigma) = (change.signal.name(), change.unit, change.size, change.sigma);
        let what = match change.cause {
            Cause::Step => format!("a step of {size:+.4} ± {sigma:.4} {unit}"),
            Cause::Ramp => format!("a ramp, which has reached {size:+.4} ± {sigma:.4} {unit}"),
            Cause::Temperature => {
                format!("follows the gyro's temperature by {size:+.5} ± {sigma:.5} {unit} for each kelvin")
            }
        };
        let when = if utc.is_empty() { format!("fix {fix}") } else { format!("fix {fix}, {utc}") };
        let instead = change.instead.map_or_else(String::new, |(cause, times)| match times {
            ..3.0 => format!("; {} is as likely", name(cause)),
            3.0..1e4 => format!("; {} is {times:.0} times less likely", name(cause)),
            _ => format!("; {} is more than 10,000 times less likely", name(cause)),
        });
        writeln!(
            out,
            "{signal:<10} {what}, {:.1} sigma of one fix, since {when}{instead}",
            change.sigmas_of_fix.abs()
        )?;
        writeln!(out, "           To do: {}", remedy(change))?;
    }
    blind(out, kinds)
}

fn name(cause: Cause) -> &'static str {
    match cause {
        Cause::Step => "a step",
        Cause::Ramp => "a ramp",
        Cause::Temperature => "the gyro's temperature",
    }
}

/// Fixes, or runs, whose mean knows the change to a quarter of its size.
fn runs(change: &Change) -> f64 {
    (4.0 / change.sigmas_of_fix).powi(2).ceil().max(2.0)
}

fn remedy(change: &Change) -> String {
    let runs = runs(change);
    match (change.signal, change.cause) {
        (Kind::Bias, Cause::Temperature) => {
            format!("bias cancels in every azimuth. Record {runs:.0} runs at either end of the temperatures at one heading, and north diagnose them.")
        }
        (Kind::Bias, _) => format!("bias cancels in every azimuth. Record {runs:.0} runs at one heading, and north diagnose them, to have it in the model."),
        (Kind::Amplitude, _) => {
            format!("check the latitude and the level first; a scale factor cancels in every azimuth. Record {runs:.0} runs at one heading, and north diagnose them.")
        }
        (Kind::Misfit, _) => "the dwells of a fix no longer fit together, and sigma is too small. Record eight runs at headings around the circle, and north diagnose them.".into(),
        (Kind::AzimuthError, _) => format!("the azimuths are wrong by this. Record {:.0} runs at surveyed headings around the circle, and north diagnose them.", runs.max(8.0)),
    }
}

/// What no signal here can show.
fn blind(out: &mut dyn Write, kinds: &[Kind]) -> io::Result<()> {
    if kinds.contains(&Kind::AzimuthError) {
        return Ok(());
    }
    writeln!(
        out,
        "not seen   what turns with the instrument, such as a field fixed to its body, is in the azimuth and in none of these signals: fixes at a \
         surveyed heading (column check_deg) show it"
    )
}

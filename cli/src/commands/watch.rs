//! `north watch`: does the error model still hold?

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use north_finder::effects::ErrorModel;
use north_finder::settings::Settings;
use serde::Serialize;

use crate::campaign::Campaign;
use crate::count::counted;
use crate::diagnose::Options;
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::model_file::ModelFile;
use crate::output::{self, JsonOption};
use crate::service::{
    ALARM, BASELINE, Cause, Change, History, Kind, Lacking, Log, Moved, Needed, OtherPlace, Watch as Verdict, report,
    signals, watch,
};
use crate::settings_file::{campaign_settings, write_model};

/// Watch the log of an instrument's fixes: does its error model still hold, what moved, by how much, since when
///
/// The first hundred fixes say what is normal. False alarms are a thousand fixes apart on average, or more. Exit code 1 where the model does not hold.
/// With --model it says which coefficient moved; with --runs the model is made anew of runs that were recorded since, if these can show what changed.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north solve year-2026 --log unit-7.csv && north watch unit-7.csv --report unit-7.html
  north watch unit-7-2025.csv unit-7-2026.csv --model unit-7.toml --json -
  north watch unit-7.csv --model unit-7.toml --runs since-june --model-out unit-7-july.toml")]
pub struct Watch {
    /// Logs of one instrument, in the order of time
    #[arg(value_name = "LOG.csv", required = true)]
    logs: Vec<PathBuf>,
    /// The error model that the instrument ran
    #[arg(long, value_name = "M.toml")]
    model: Option<PathBuf>,
    /// A campaign recorded since the change, to make the model anew from
    #[arg(long, value_name = "CAMPAIGN", requires = "model_out")]
    runs: Option<PathBuf>,
    /// Write the new model
    #[arg(long, value_name = "M.toml", requires = "runs")]
    model_out: Option<PathBuf>,
    /// Write a report with the history drawn: one HTML file that fetches nothing
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

#[derive(Serialize)]
struct Said<'a> {
    fixes: usize,
    holds: bool,
    signals: Vec<Kind>,
    /// What only some fixes have, which is not watched; fixes of other error models before these.
    left_out: &'a [Lacking],
    other_models: usize,
    /// Number of the fix with which the alarm came.
    alarm_fix: Option<u64>,
    /// For every change: number and time of its first fix, the coefficient that moved, another place that would explain it, the runs that show it best.
    since: Vec<Since<'a>>,
    moved: &'a [Option<Moved>],
    other_place: &'a [Option<OtherPlace>],
    needed: &'a [Needed],
    /// The model that was made anew of runs, where one was asked for.
    model_out: Option<Made<'a>>,
    #[serde(flatten)]
    verdict: &'a Verdict,
}

#[derive(Serialize)]
struct Since<'a> {
    fix: u64,
    utc: &'a str,
}

/// A model that was written.
#[derive(Clone, Copy, Serialize)]
struct Made<'a> {
    file: &'a Path,
    runs: &'a Path,
    /// The change that it takes into account.
    signal: Kind,
}

impl Watch {
    pub fn run(self) -> Result<(), Failure> {
        let results = [self.model_out.as_deref(), self.report.as_deref(), self.json.path()];
        let manifest = self.runs.as_deref().map(Campaign::manifest_of);
        let read = self.logs.iter().chain(&self.model).chain(&manifest).map(PathBuf::as_path);
        output::check_beside(read, results)?;
        let (log, other_models) = Log::read(&self.logs)?.of_last_model();
        for warning in &log.warnings {
            output::warn(warning);
        }
        let model = self.model.as_deref().map(ModelFile::read).transpose()?.and_then(|file| file.error_model);
        let count = log.fixes.len();
        if count <= BASELINE {
            let of_model = if other_models > 0 {
                format!(" of the last error model, after {other_models} of others")
            } else {
                String::new()
            };
            let text = format!(
                "the logs hold {}{of_model}; the first {BASELINE} say what is normal, and there are none to watch",
                counted(count, "fix")
            );
            return Err(Failure::Refused(text));
        }
        let (signals, left_out) = signals(&log.fixes);
        let temperatures_c = log.temperatures_c();
        let verdict = watch(&signals, &log.switched(), temperatures_c.as_deref());
        if verdict.watched == 0 {
            let lack = |each: &Lacking| format!("; fix {} lacks its {}", each.first_fix, each.signal.name());
            let text = format!(
                "no signal that every fix has, and that moves: bias_deg_h, amplitude_deg_h, misfit with freedom, azimuth_deg with check_deg{}",
                left_out.iter().map(lack).collect::<String>()
            );
            return Err(Failure::Refused(text));
        }
        let history = History::new((&log, other_models), (&signals, &left_out), verdict, model.as_ref());
        write(&mut self.json.human(), &history)?;
        if let Some(path) = &self.report {
            crate::output::write(path, report::html(&history)).map_err(|error| FileError::whole(path, error))?;
        }
        let verdict = &history.verdict;
        let updated = self.update(&history, model);
        self.json.write(&Said {
            fixes: count,
            holds: verdict.alarm.is_none(),
            alarm_fix: verdict.alarm.map(|at| log.fixes[at].fix),
            since: verdict.changes.iter().map(|change| since(&log, change)).collect(),
            signals: signals.iter().map(|signal| signal.kind).collect(),
            left_out: &left_out,
            other_models,
            moved: &history.moved,
            other_place: &history.other_place,
            needed: &history.needed,
            model_out: updated.as_ref().ok().copied().flatten(),
            verdict,
        })?;
        if let Some(Made { file, runs, signal }) = updated? {
            let (file, runs, signal) = (file.display(), runs.display(), signal.name());
            writeln!(
                self.json.human(),
                "written    {file}: the model made anew of {runs}, by what changed in the {signal}"
            )?;
        }
        match verdict.alarm {
            Some(at) => {
                Err(Failure::Refused(format!("the error model no longer holds: seen with fix {}", log.fixes[at].fix)))
            }
            None => Ok(()),
        }
    }

    /// The model from the runs since the change, if that was asked for.
    fn update(&self, history: &History<'_>, model: Option<ErrorModel>) -> Result<Option<Made<'_>>, Failure> {
        let (Some(runs), Some(file)) = (&self.runs, &self.model_out) else { return Ok(None) };
        let Some((change, needed)) = history.verdict.changes.iter().zip(&history.needed).next() else {
            return Err(Failure::Refused("the model holds: there is nothing to make anew".into()));
        };
        let campaign = Campaign::read(runs)?;
        campaign.check_copies()?;
        let settings = Settings { model, ..campaign_settings(&campaign, None)? };
        let updated = needed.updated(change, &campaign, &Options { settings, ..Options::default() })?;
        write_model(file, &updated)?;
        Ok(Some(Made { file, runs, signal: change.signal }))
    }
}

fn since<'a>(log: &'a Log, change: &Change) -> Since<'a> {
    let fix = &log.fixes[change.from];
    Since { fix: fix.fix, utc: &fix.utc }
}

fn write(out: &mut dyn Write, history: &History<'_>) -> io::Result<()> {
    let History { log, verdict, .. } = history;
    let kinds: Vec<Kind> = history.signals.iter().map(|signal| signal.kind).collect();
    let switches = log.switched().iter().filter(|&&switched| switched).count();
    writeln!(
        out,
        "{}, {} between them; the first {BASELINE} say what is normal",
        counted(log.fixes.len(), "fix"),
        counted(switches, "switch-on")
    )?;
    writeln!(out, "signals    {}", kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", "))?;
    for said in history.not_watched() {
        writeln!(out, "left out   {said}")?;
    }
    let most = verdict.statistic.iter().copied().fold(0.0, f64::max);
    let Some(at) = verdict.alarm else {
        writeln!(
            out,
            "holds      {} watched; the statistic was {most:.1} at most, and {ALARM} is an alarm, of which false ones come after {ALARM} fixes \
             on average, or later",
            counted(verdict.watched, "fix")
        )?;
        return blind(out, &kinds);
    };
    let after = match log.fixes.len() - at - 1 {
        0 => String::new(),
        count => {
            format!("; its size takes in the {} after it, in which no further one is looked for", counted(count, "fix"))
        }
    };
    writeln!(
        out,
        "changed    seen with fix {}, {} after the baseline{after}",
        log.fixes[at].fix,
        counted(verdict.watched, "fix")
    )?;
    for (number, change) in verdict.changes.iter().enumerate() {
        writeln!(out, "{:<10} {}", change.signal.name(), what(log, change))?;
        if let Some(moved) = history.moved.get(number).and_then(Option::as_ref) {
            writeln!(out, "           {}", coefficient(moved))?;
        }
        if let Some(place) = history.other_place.get(number).and_then(Option::as_ref) {
            writeln!(out, "           {}", other_place(place))?;
        }
        writeln!(out, "           To do: {}", remedy(change, &history.needed[number]))?;
    }
    blind(out, &kinds)
}

/// A change in words.
fn what(log: &Log, change: &Change) -> String {
    let Since { fix, utc } = since(log, change);
    let (unit, size, sigma) = (change.unit, change.size, change.sigma);
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
    let passed = if change.passed { "; the fixes after the alarm no longer show it" } else { "" };
    format!("{what}, {:.1} sigma of one fix, since {when}{instead}{passed}", change.sigmas_of_fix.abs())
}

fn coefficient(moved: &Moved) -> String {
    let Moved { coefficient, unit, before, by, sigma } = moved;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!(
        "in the model: {coefficient} is {before:.6}{unit}, and has moved by {by:+.6} ± {sigma:.6} to {:.6}",
        before + by
    )
}

fn other_place(place: &OtherPlace) -> String {
    let OtherPlace { latitude_before_deg, latitude_after_deg, set_up_anew } = place;
    let likely = if *set_up_anew {
        "; it was set up anew with that fix, so that this is the first to check"
    } else {
        "; it was not set up anew with that fix"
    };
    format!(
        "or another place: the amplitude was that at a latitude of {latitude_before_deg:.2}°, and is that at {latitude_after_deg:.2}°{likely}"
    )
}

fn name(cause: Cause) -> &'static str {
    match cause {
        Cause::Step => "a step",
        Cause::Ramp => "a ramp",
        Cause::Temperature => "the gyro's temperature",
    }
}

fn remedy(change: &Change, needed: &Needed) -> String {
    let runs = needed.sentence();
    match change.signal {
        Kind::Bias => format!("bias cancels in every azimuth. {runs}"),
        Kind::Amplitude => {
            format!("check the latitude and the level first; a scale factor cancels in every azimuth. {runs}")
        }
        Kind::Misfit => misfit(change, &runs),
        Kind::AzimuthError => format!("the azimuths are wrong by this. {runs}"),
    }
}

/// A misfit that rises and one that falls are different things.
fn misfit(change: &Change, runs: &str) -> String {
    match change.cause {
        Cause::Temperature => {
            let end = if change.size > 0.0 { "warmer" } else { "colder" };
            format!("the {end} the gyro is, the worse the dwells of a fix fit together, and sigma is too small there. {runs}")
        }
        _ if change.size > 0.0 => {
            format!("the dwells of a fix no longer fit together, and sigma is too small. {runs}")
        }
        _ => "the dwells of a fix fit together better than before, and sigma is wider than it need be: the base is quieter, the gyro's noise is less or \
              its rates are smoothed. north characterise says what noise to declare"
            .into(),
    }
}

/// What no signal here can show.
fn blind(out: &mut dyn Write, kinds: &[Kind]) -> io::Result<()> {
    if kinds.contains(&Kind::AzimuthError) {
        return Ok(());
    }
    writeln!(
        out,
        "not seen   what turns with the instrument, such as a field fixed to its body, is in the azimuth and in none of these signals: fixes that all \
         are at surveyed headings (column check_deg) show it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chi-square rises where the dwells fit together worse than declared, and falls where they fit better.
    #[test]
    fn each_sign_of_a_misfit_is_explained() {
        let change = |cause, size| Change {
            signal: Kind::Misfit,
            unit: Kind::Misfit.unit(),
            from: 150,
            cause,
            size,
            sigma: 0.1,
            sigmas_of_fix: size,
            instead: None,
            share: 1.0,
            passed: false,
        };
        let said = |cause, size| misfit(&change(cause, size), "Record 8 runs");
        assert!(said(Cause::Step, 2.6).contains("sigma is too small") && said(Cause::Step, 2.6).contains("8 runs"));
        assert!(said(Cause::Ramp, -2.6).contains("wider than it need be"));
        assert!(said(Cause::Temperature, 0.1).contains("warmer") && said(Cause::Temperature, -0.1).contains("colder"));
    }
}

//! The diagnosis on a terminal.

use std::io::{self, Write};

use super::statistics::p_value_in_words;
use super::warnings::{Line, grouped};
use super::{Diagnosis, InFamily, RunDiagnosis};
use crate::count::counted;

/// Most candidates that are listed as left.
const LISTED: usize = 8;

/// Writes the diagnosis for a person.
pub fn write(out: &mut dyn Write, diagnosis: &Diagnosis) -> io::Result<()> {
    writeln!(out, "{}", diagnosis.verdict)?;
    for Line { place, message } in grouped(&diagnosis.warnings) {
        let place = if place.is_empty() { place } else { format!("{place}: ") };
        writeln!(out, "warning: {place}{message}")?;
    }
    write_runs(out, diagnosis)?;
    write_effects(out, diagnosis)?;
    writeln!(
        out,
        "\nresidual of a {}: {:.4} deg/h rms before, {:.4} after; noise of a second {:.4}",
        diagnosis.residual_of,
        diagnosis.residual_rms_before_deg_h,
        diagnosis.residual_rms_after_deg_h,
        diagnosis.noise.noise_deg_h
    )?;
    for (when, tests) in [("before", &diagnosis.noise.before), ("after", &diagnosis.noise.after)] {
        let words: Vec<String> = tests
            .iter()
            .map(|test| match test.not_applied {
                Some(why) => format!("{} not applied: {why}", test.name),
                None => {
                    let outcome = if test.passed { "passed" } else { "failed" };
                    format!("{} {outcome} ({})", test.name, p_value_in_words(test.p_value))
                }
            })
            .collect();
        writeln!(out, "  {when:6}: {}", words.join(", "))?;
    }
    for evidence in &diagnosis.unexplained_evidence {
        writeln!(out, "unexplained: {evidence}")?;
    }
    if let Some(family) = &diagnosis.family {
        write_family(out, family)?;
    }
    let left: Vec<_> = diagnosis.rejected.iter().take(LISTED).collect();
    if !left.is_empty() {
        writeln!(out, "\nleft (of {} candidates):", diagnosis.candidates.len())?;
        for each in left {
            let channel = each.channel.as_deref().map_or(String::new(), |channel| format!(" ({channel})"));
            writeln!(out, "  {}{channel}: {}", each.name, each.why)?;
        }
    }
    if let Some(experiment) = &diagnosis.next_experiment {
        writeln!(out, "\nnext experiment: {}", experiment.description)?;
        let angles = |angles: &[f64]| {
            angles.iter().map(|angle| format!("{angle:.1}").replace(".0", "")).collect::<Vec<_>>().join(", ")
        };
        if !experiment.order_deg.is_empty() {
            let (order, headings) = (angles(&experiment.order_deg), angles(&experiment.headings_deg));
            writeln!(out, "  positions {order} deg; headings {headings} deg; channels as in {}", experiment.like)?;
        }
    }
    if !diagnosis.inseparable.is_empty() {
        let names = diagnosis.inseparable.join(", ");
        writeln!(out, "\nno order, heading or duration at this latitude would tell what was named from: {names}")?;
    }
    Ok(())
}

fn write_family(out: &mut dyn Write, family: &InFamily) -> io::Result<()> {
    writeln!(out, "\nfamily: out of it with probability {:.3}", family.outside)?;
    for effect in &family.effects {
        let absent = 1.0 - effect.family - effect.own;
        writeln!(
            out,
            "  {} ({:.0} % of the units have it): as the others {:.3}, in a way of its own {:.3}, not at all {:.3}",
            effect.name,
            100.0 * effect.share,
            effect.family,
            effect.own,
            absent.max(0.0)
        )?;
    }
    Ok(())
}

fn write_runs(out: &mut dyn Write, diagnosis: &Diagnosis) -> io::Result<()> {
    let width = diagnosis.runs.iter().map(|run| run.file.chars().count()).max().unwrap_or_default().max(4);
    writeln!(
        out,
        "\n{:<width$}  role   before (sigma), deg        after (sigma), deg      error before  after",
        "run"
    )?;
    for run in &diagnosis.runs {
        write_run(out, run, width)?;
    }
    let rms = |value: Option<f64>, interval: Option<[f64; 2]>| match (value, interval) {
        (Some(value), Some([low, high])) => format!("{value:.4} ({low:.4} to {high:.4})"),
        _ => "-".into(),
    };
    if let (Some(before), Some(after)) = (diagnosis.station_spread_before_deg, diagnosis.station_spread_after_deg) {
        writeln!(
            out,
            "azimuths of one station without a survey apart, deg rms: {before:.4} before, {after:.4} after (training runs by models learned \
             without them)"
        )?;
    }
    if let Some(judged_on) = diagnosis.judged_on.filter(|judged_on| *judged_on != "stations") {
        let had = diagnosis.judged_before();
        let only = if had < diagnosis.judged_runs { format!(", {had} of them before") } else { String::new() };
        writeln!(
            out,
            "azimuth error, deg rms (95 % interval by chi-square), judged on {} ({}{only}): {} before, {} after",
            judged_on.replace('-', " "),
            counted(diagnosis.judged_runs, "run"),
            rms(diagnosis.azimuth_rms_before_deg, diagnosis.azimuth_rms_before_interval_deg),
            rms(diagnosis.azimuth_rms_after_deg, diagnosis.azimuth_rms_after_interval_deg)
        )?;
    }
    if diagnosis.judged_on == Some("cross-validation") {
        writeln!(
            out,
            "after: the errors of judged runs come from models learned without them, the azimuths from the written model"
        )?;
    }
    if let Some(all) = &diagnosis.leave_one_out {
        writeln!(
            out,
            "each of all runs by what was learned from the others ({}): {} after{}; errors over sigma {:.2} rms",
            counted(all.runs, "run"),
            rms(Some(all.azimuth_rms_deg), Some(all.azimuth_rms_interval_deg)),
            all.azimuth_rms_before_deg.map_or(String::new(), |before| format!(", {before:.4} before")),
            all.errors_over_sigma_rms
        )?;
    }
    Ok(())
}

fn write_run(out: &mut dyn Write, run: &RunDiagnosis, width: usize) -> io::Result<()> {
    let azimuth = |azimuth: Option<f64>, sigma: Option<f64>| match (azimuth, sigma) {
        (Some(azimuth), Some(sigma)) => format!("{azimuth:9.4} ({sigma:8.4})"),
        _ => "-".into(),
    };
    let error = |error: Option<f64>| error.map_or("-".into(), |error| format!("{error:+.4}"));
    let role = format!("{:?}", run.role).to_lowercase();
    writeln!(
        out,
        "{:<width$}  {role:<5}  {:>22}  {:>22}  {:>10}  {:>10}",
        run.file,
        azimuth(run.azimuth_before_deg, run.sigma_before_deg),
        azimuth(run.azimuth_after_deg, run.sigma_after_deg),
        error(run.error_before_deg),
        error(run.error_after_deg)
    )?;
    run.notes.iter().try_for_each(|note| writeln!(out, "{:width$}  {note}", ""))
}

fn write_effects(out: &mut dyn Write, diagnosis: &Diagnosis) -> io::Result<()> {
    if diagnosis.effects.is_empty() {
        return writeln!(out, "\nno effect was found");
    }
    writeln!(out, "\neffects:")?;
    for effect in &diagnosis.effects {
        let parameters: Vec<String> = effect
            .parameters
            .iter()
            .map(|(name, value)| match effect.sigma.get(name) {
                Some(sigma) => format!("{name} = {value:.6} ± {sigma:.6}"),
                None => format!("{name} = {value:.6}"),
            })
            .collect();
        writeln!(out, "  {}: {}; {}", effect.full_name(), parameters.join(", "), p_value_in_words(effect.p_value))?;
        writeln!(out, "    {}", effect.evidence)?;
        if !effect.ambiguous_with.is_empty() {
            writeln!(out, "    this campaign cannot tell it from: {}", effect.ambiguous_with.join(", "))?;
        }
    }
    for lack in &diagnosis.board_lacks {
        writeln!(out, "  a board runs the model without {}: {}", lack.effect, lack.why)?;
    }
    Ok(())
}

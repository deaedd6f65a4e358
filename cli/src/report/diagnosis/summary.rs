//! The head of the page: the verdict in a sentence, and the few numbers that carry it.

use crate::campaign::Role;
use crate::count::counted;
use crate::diagnose::{Diagnosis, Origin, RunDiagnosis};
use crate::report::{code_list, escape, number, p_value, tile};

pub fn section(diagnosis: &Diagnosis) -> String {
    let title = diagnosis.title.as_deref().unwrap_or("Campaign");
    let mut html = format!(
        "<h1>{}</h1>\n<p class=\"soft\">{}</p>\n<p class=\"verdict\">{}</p>\n",
        escape(title),
        origin(&diagnosis.origin),
        escape(&diagnosis.verdict)
    );
    html.push_str("<div class=\"tiles\">\n");
    if let (Some(before), Some(after)) = (diagnosis.azimuth_rms_before_deg, diagnosis.azimuth_rms_after_deg) {
        let intervals = [diagnosis.azimuth_rms_before_interval_deg, diagnosis.azimuth_rms_after_interval_deg];
        html += &tile("Azimuth error, rms", &change(before, after, "°"), &azimuth_note(diagnosis, intervals));
    }
    let (before, after) = (diagnosis.residual_rms_before_deg_h, diagnosis.residual_rms_after_deg_h);
    let which = if diagnosis.runs.iter().any(|run| run.role == Role::Check) { "check runs" } else { "all runs" };
    let alone = number(diagnosis.noise.noise_deg_h, 3);
    let noise = if diagnosis.residual_of == "dwell" {
        format!("dwells of the {which}; noise of a second, estimated from fast changes: {alone} °/h")
    } else if after <= diagnosis.noise.noise_deg_h {
        format!(
            "seconds of the {which}; no more than the noise of {alone} °/h, as it is estimated from fast changes, would leave"
        )
    } else {
        format!("seconds of the {which}; noise alone, estimated from fast changes: {alone} °/h")
    };
    html += &tile("Residual of the rate, rms", &change(before, after, " °/h"), &noise);
    let names: Vec<String> = diagnosis.effects.iter().map(|effect| effect.name.clone()).collect();
    let found = match names.len() {
        0 => "no effect".to_owned(),
        count => counted(count, "effect"),
    };
    let named = match names.as_slice() {
        [] if diagnosis.withdrawn.is_some() => "what was found is not used".to_owned(),
        [] if diagnosis.unexplained => "no candidate explains what stands out of the noise".to_owned(),
        [] => "nothing stands out of the noise".to_owned(),
        names => code_list(names),
    };
    html += &tile("Learned", &found, &named);
    confidence(&mut html, diagnosis);
    let failed = diagnosis.noise.after.iter().filter(|test| test.failed()).count();
    let confounded = confounded(diagnosis);
    let (open, open_note) = match (diagnosis.unexplained, failed) {
        (true, _) => ("structure remains", "that no candidate explains".to_owned()),
        (false, 0) if !confounded.is_empty() => (
            "which cause it is",
            format!("the residual passes for noise, but these explain it as well: {}", code_list(&confounded)),
        ),
        (false, 0) => ("nothing that shows", "the residual passes for noise".to_owned()),
        (false, failed) => ("not quite noise", format!("{failed} of {} tests fail", diagnosis.noise.after.len())),
    };
    let mut doubts = vec![open_note];
    doubts.extend(diagnosis.withdrawn.as_deref().map(escape));
    if !diagnosis.missed_references.is_empty() {
        let files: Vec<String> = diagnosis.missed_references.iter().map(|each| each.file.clone()).collect();
        doubts.push(format!("references missed: {}", code_list(&files)));
    }
    if !diagnosis.warnings.is_empty() {
        doubts.push(format!("{} below", counted(diagnosis.warnings.len(), "warning")));
    }
    html += &tile("Still open", open, &doubts.join("; "));
    html.push_str("</div>\n");
    html
}

/// What made the page, when and of what.
fn origin(origin: &Origin) -> String {
    let mut parts = vec![format!("north {}", escape(origin.version))];
    parts.extend(origin.made.as_deref().map(escape));
    parts.extend(origin.instrument.as_deref().map(|name| format!("instrument {}", escape(name))));
    parts.extend(origin.latitude_deg.map(|latitude| format!("latitude {}°", number(latitude, 6))));
    parts.join(" · ")
}

/// What explains the data as well as what was named.
fn confounded(diagnosis: &Diagnosis) -> Vec<String> {
    let mut names: Vec<String> = diagnosis.effects.iter().flat_map(|each| each.ambiguous_with.clone()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// How sure it is: that there is something, by the effect that is least certain; that it is what was named; and whether sigmas hold.
fn confidence(html: &mut String, diagnosis: &Diagnosis) {
    let least = diagnosis.effects.iter().map(|effect| effect.p_value).fold(f64::NAN, f64::max);
    let value = if least.is_finite() { p_value(least) } else { "nothing learned".to_owned() };
    let mut notes = Vec::new();
    if least.is_finite() {
        notes.push("chance that noise alone shows as much as the least certain effect, the search counted; it is no probability of the name".to_owned());
        notes.push(match confounded(diagnosis).as_slice() {
            [] => "no other candidate explains the data as well as what was named".to_owned(),
            names => format!("which cause it is, is open: {} explain the data as well", code_list(names)),
        });
    }
    let judged: Vec<(f64, f64)> =
        diagnosis.runs.iter().filter_map(|run| Some((run.error_after_deg?, run.sigma_after_deg?))).collect();
    if !judged.is_empty() {
        let within = judged.iter().filter(|(error, sigma)| error.abs() <= 1.96 * sigma).count();
        notes.push(format!("{within} of {} judged runs within 1.96 sigma", judged.len()));
    }
    *html += &tile("That there is something", &value, &notes.join("; "));
}

fn change(before: f64, after: f64, unit: &str) -> String {
    match (number(before, 3), number(after, 3)) {
        (before, after) if before == after => format!("{after}{unit}, unchanged"),
        (before, after) => format!("{before} → {after}{unit}"),
    }
}

fn azimuth_note(diagnosis: &Diagnosis, intervals: [Option<[f64; 2]>; 2]) -> String {
    let count = |error: fn(&RunDiagnosis) -> Option<f64>| diagnosis.runs.iter().filter_map(error).count();
    let (before, after) = (count(|run| run.error_before_deg), count(|run| run.error_after_deg));
    let judged = match before == after {
        true => counted(after, "run"),
        false => format!("{} before and {after} after", counted(before, "run")),
    };
    let how = match diagnosis.judged_on {
        Some("cross-validation") => "cross-validated over the runs that were learned from".to_owned(),
        _ => format!("on {judged}, which took no part in learning"),
    };
    match intervals {
        [Some([b0, b1]), Some([a0, a1])] => format!(
            "{how}; 95 % intervals {}–{}° and {}–{}°",
            number(b0, 2),
            number(b1, 2),
            number(a0, 2),
            number(a1, 2)
        ),
        _ => how,
    }
}

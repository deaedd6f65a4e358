//! What was found, what was left, what is next: the parts of the page that are read.

use std::fmt::Write;

use crate::diagnose::warnings::{Line, grouped};
use crate::diagnose::{Diagnosis, Effect, Experiment, Test};
use crate::report::{
    Axis, Canvas, Legend, Plot, code_list, escape, figure, file, number, p_value, probability, short, table, with_sigma,
};
use crate::settings_file::model_text;

/// Candidates that are shown at once; the others unfold.
const CANDIDATES: usize = 8;

pub fn effects(diagnosis: &Diagnosis) -> String {
    let mut html = String::from("<h2>What was learned</h2>\n");
    if diagnosis.effects.is_empty() {
        let why = match &diagnosis.withdrawn {
            Some(_) => "Effects were found and are not used, for the reason above.",
            None if diagnosis.unexplained => {
                "Structure stands out of the noise, and no effect of the grammar explains it, given how many were tried."
            }
            None => "No effect stands out of the noise, given how many were tried.",
        };
        let _ = writeln!(html, "<p>{why} The model stays as it is.</p>");
    }
    for effect in &diagnosis.effects {
        html.push_str(&card(effect));
    }
    html
}

fn card(effect: &Effect) -> String {
    let mut html = format!("<article class=\"card\"><header><h3><code>{}</code></h3>", escape(&effect.name));
    if effect.kind != effect.name {
        let _ = write!(html, "<span class=\"tag\">{}</span>", escape(effect.kind));
    }
    for channel in &effect.channels {
        let _ = write!(html, "<span class=\"tag\">channel {}</span>", escape(channel));
    }
    let _ = write!(html, "<span class=\"tag\">{}, the search counted</span>", p_value(effect.p_value));
    let board = if effect.board { "runs on the board" } else { "not measured by the board" };
    let _ = writeln!(html, "<span class=\"tag\">{board}</span></header>");
    let _ = writeln!(html, "<p>{}</p>", escape(&effect.evidence));
    if !effect.parameters.is_empty() {
        let rows: Vec<Vec<String>> = effect
            .parameters
            .iter()
            .map(|(name, &value)| {
                let (quantity, unit) = unit_of(name);
                vec![quantity, with_sigma(value, effect.sigma.get(name).copied()), unit]
            })
            .collect();
        html.push_str(&table(&[("parameter", false), ("value", true), ("unit", false)], &rows));
    }
    if !effect.ambiguous_with.is_empty() {
        let _ = writeln!(
            html,
            "<div class=\"note\"><p>This campaign cannot tell it from {}: they explain it as well.</p></div>",
            code_list(&effect.ambiguous_with)
        );
    }
    html.push_str("</article>\n");
    html
}

/// What a parameter's name says: the quantity, and its unit for a person.
fn unit_of(name: &str) -> (String, String) {
    const UNITS: [(&str, &str); 13] = [
        ("deg_h_per_k_per_s", "°/h per K/s"),
        ("deg_h_per_k2", "°/h per K²"),
        ("deg_h_per_k", "°/h per K"),
        ("deg_h_per_unit_per_s", "°/h per unit of the channel per s"),
        ("deg_h_per_unit3", "°/h per cubed unit of the channel"),
        ("deg_h_per_unit2", "°/h per squared unit of the channel"),
        ("deg_h_per_unit", "°/h per unit of the channel"),
        ("deg_h_per_h2", "°/h per h²"),
        ("deg_h_per_h", "°/h per h"),
        ("deg_h", "°/h"),
        ("deg", "°"),
        ("arcsec", "″"),
        ("s", "s"),
    ];
    for (suffix, unit) in UNITS {
        if name == suffix {
            return ("size".into(), unit.into());
        }
        if let Some(quantity) = name.strip_suffix(suffix).and_then(|quantity| quantity.strip_suffix('_')) {
            return (escape(&quantity.replace('_', " ")), unit.into());
        }
    }
    (escape(&name.replace('_', " ")), String::new())
}

pub fn candidates(diagnosis: &Diagnosis) -> String {
    if diagnosis.candidates.is_empty() && diagnosis.rejected.is_empty() {
        return String::new();
    }
    let mut html = format!(
        "<h2>Why these, and not others</h2>\n<p>{} candidates were built from the recording. Each p-value is corrected for how \
         many were searched.</p>\n",
        diagnosis.candidates.len()
    );
    let mut sorted: Vec<_> = diagnosis.candidates.iter().collect();
    sorted.sort_by(|a, b| {
        b.taken
            .cmp(&a.taken)
            .then(a.p_value_searched.total_cmp(&b.p_value_searched))
            .then(b.improvement.total_cmp(&a.improvement))
    });
    let rows: Vec<Vec<String>> = sorted
        .iter()
        .map(|candidate| {
            let verdict = if candidate.taken {
                "<span class=\"good\">✓ taken</span>"
            } else {
                "<span class=\"soft\">left</span>"
            };
            let name = match &candidate.channel {
                Some(channel) if !candidate.name.contains(channel.as_str()) => {
                    format!("<code>{}</code> of {}", escape(&candidate.name), escape(channel))
                }
                _ => format!("<code>{}</code>", escape(&candidate.name)),
            };
            vec![
                name,
                number(candidate.improvement, 3),
                probability(candidate.p_value_searched),
                verdict.to_owned(),
                escape(&candidate.why),
            ]
        })
        .collect();
    let head = [("candidate", false), ("gain", true), ("p", true), ("verdict", false), ("why", false)];
    let (shown, hidden) = rows.split_at(rows.len().min(CANDIDATES));
    html.push_str(&table(&head, shown));
    if !hidden.is_empty() {
        let _ = writeln!(
            html,
            "<details><summary>{} more candidates</summary>\n{}</details>",
            hidden.len(),
            table(&head, hidden)
        );
    }
    html.push_str("<p class=\"soft foot\">Gain: fall of the sum of squares, in noise variances.</p>\n");
    if !diagnosis.rejected.is_empty() {
        html.push_str("<details><summary>Left, with the reason</summary>\n<ul>");
        for rejected in &diagnosis.rejected {
            let _ = writeln!(html, "<li><code>{}</code>: {}</li>", escape(&rejected.name), escape(&rejected.why));
        }
        html.push_str("</ul></details>\n");
    }
    html
}

pub fn noise(diagnosis: &Diagnosis) -> String {
    let noise = &diagnosis.noise;
    if noise.before.is_empty() && noise.after.is_empty() {
        return String::new();
    }
    let verdict = |test: Option<&Test>| match test {
        None => "–".to_owned(),
        Some(test) => {
            let (class, word) = match test.not_applied {
                Some(why) => ("", why),
                None if test.passed => ("good", "✓ noise"),
                None => ("bad", "✗ structure"),
            };
            format!("<span class=\"{class}\">{word}</span> <span class=\"p\">{}</span>", p_value(test.p_value))
        }
    };
    let names =
        noise.before.iter().chain(noise.after.iter().filter(|test| noise.before.iter().all(|it| it.name != test.name)));
    let rows: Vec<Vec<String>> = names
        .map(|test| {
            let find = |tests: &[Test]| verdict(tests.iter().find(|it| it.name == test.name));
            vec![
                format!("<code>{}</code>", escape(&test.name)),
                escape(&test.about),
                find(&noise.before),
                find(&noise.after),
            ]
        })
        .collect();
    let head = [("test", false), ("asks", false), ("before", false), ("after", false)];
    format!("<h2>Is it noise?</h2>\n{}", table(&head, &rows))
}

pub fn experiment(diagnosis: &Diagnosis) -> String {
    let inseparable = match diagnosis.inseparable.as_slice() {
        [] => String::new(),
        names => format!(
            "<p>No order, heading or duration at this latitude would tell what was named from: {}.</p>\n",
            code_list(names)
        ),
    };
    let Some(experiment) = &diagnosis.next_experiment else { return inseparable };
    let mut html = format!("<h2>The next experiment</h2>\n<p>{}</p>\n{inseparable}", escape(&experiment.description));
    if experiment.order_deg.len() > 1 && experiment.dwell_s > 0.0 {
        html.push_str(&order(experiment));
    } else {
        return html;
    }
    let headings: Vec<String> = experiment.headings_deg.iter().map(|heading| format!("{}°", short(*heading))).collect();
    let rows = vec![
        vec!["tells apart".to_owned(), code_list(&experiment.separates)],
        vec!["azimuths of the mark".to_owned(), headings.join(", ")],
        vec!["time at each position".to_owned(), format!("{} s", short(experiment.dwell_s))],
        vec!["after switch-on".to_owned(), format!("{} s", short(experiment.warm_up_s))],
        vec![
            "the mount leans by".to_owned(),
            format!("{}° of pitch, {}° of roll", short(experiment.pitch_deg), short(experiment.roll_deg)),
        ],
        vec!["channels as in".to_owned(), format!("<code>{}</code>", escape(&experiment.like))],
        vec![
            "expected log odds over the nearest other".to_owned(),
            experiment.expected_log_odds.map_or("–".into(), |odds| format!("{odds:.0}")),
        ],
        vec![
            "sigma of a usual azimuth".to_owned(),
            format!("{:.4}° now, {:.4}° then", experiment.sigma_now_deg, experiment.sigma_then_deg),
        ],
    ];
    html.push_str(&table(&[("", false), ("", false)], &rows));
    html
}

/// The index angle over one run of the proposed experiment.
fn order(experiment: &Experiment) -> String {
    let draw = |canvas: Canvas| {
        let angles = experiment.order_deg.iter().copied();
        let end_s = experiment.order_deg.len() as f64 * experiment.dwell_s;
        let x = Axis::exact("time at the positions, s", 0.0, end_s);
        let mut plot = Plot::new(canvas.width, 190.0, x, Axis::linear("index angle, °", angles.clone()));
        let mut ticks: Vec<f64> = angles.clone().collect();
        ticks.sort_unstable_by(f64::total_cmp);
        ticks.dedup();
        if ticks.len() <= 5 {
            plot.y_ticks(ticks.into_iter().map(|angle| (angle, short(angle))).collect());
        }
        let steps = angles.enumerate().flat_map(|(i, angle)| {
            [(i as f64 * experiment.dwell_s, angle), ((i + 1) as f64 * experiment.dwell_s, angle)]
        });
        plot.line("line after", steps);
        vec![plot]
    };
    figure(
        Legend::None,
        "Index angle over a run of the proposed experiment",
        "Order of the positions in each run.",
        draw,
    )
}

pub fn open(diagnosis: &Diagnosis) -> String {
    let mut html = String::from("<h2>What is still open</h2>\n");
    if diagnosis.unexplained {
        html.push_str("<div class=\"note\"><p>Structure remains that no candidate explains:</p><ul>");
        for evidence in &diagnosis.unexplained_evidence {
            let _ = write!(html, "<li>{}</li>", escape(evidence));
        }
        html.push_str("</ul></div>\n");
    } else {
        let failed: Vec<String> =
            diagnosis.noise.after.iter().filter(|test| test.failed()).map(|test| test.name.clone()).collect();
        if failed.is_empty() {
            html.push_str("<p>What is left of the rate passes for noise.</p>\n");
        } else {
            let _ =
                writeln!(html, "<p>What is left of the rate is not quite noise; it fails: {}.</p>", code_list(&failed));
        }
    }
    if !diagnosis.warnings.is_empty() {
        html.push_str("<h3>Doubts about the campaign</h3>\n<ul>");
        for Line { place, message } in grouped(&diagnosis.warnings) {
            let place = if place.is_empty() { place } else { format!("<code>{}</code>: ", escape(&place)) };
            let _ = writeln!(html, "<li>{place}{}</li>", escape(&message));
        }
        html.push_str("</ul>\n");
    }
    html
}

pub fn model(diagnosis: &Diagnosis) -> String {
    let Ok(text) = model_text(&diagnosis.model) else { return String::new() };
    format!(
        "<h2>The model as a file</h2>\n<p>For <code>north solve --model</code> and <code>north load</code>:{}</p>\n\
         <pre>{}</pre>\n",
        file("model.toml", "application/toml", &text),
        escape(&text)
    )
}

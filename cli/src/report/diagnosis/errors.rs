//! Azimuth errors: of each run, and against the heading.

use std::path::Path;

use north_finder::units::{wrap_180_deg, wrap_360_deg};

use crate::campaign::Role;
use crate::count::counted;
use crate::diagnose::{Diagnosis, RunDiagnosis};
use crate::report::{Axis, Canvas, Legend, Plot, Side, cell, csv, escape, figure, short, table, with_sigma};

/// From this ratio on, the errors after are drawn a second time at a scale of their own.
const ENLARGE: f64 = 4.0;
/// Headings that spread less than this say nothing about the heading.
const HEADINGS_DEG: f64 = 20.0;

/// An error of a run with its sigma.
struct Error {
    run: usize,
    heading_deg: f64,
    /// Before and after; a run need not have an azimuth both times.
    value_deg: [Option<f64>; 2],
    sigma_deg: [f64; 2],
}

impl Error {
    /// Value and sigma.
    fn of(&self, side: Side) -> Option<(f64, f64)> {
        match side {
            Side::Before => Some((self.value_deg[0]?, self.sigma_deg[0])),
            Side::After => Some((self.value_deg[1]?, self.sigma_deg[1])),
        }
    }
}

pub fn section(diagnosis: &Diagnosis) -> String {
    let errors = errors(diagnosis);
    let mut html = String::from("<h2>Azimuth of each run</h2>\n");
    if errors.is_empty() {
        html.push_str(
            "<p>No run that is judged has a surveyed azimuth: how far the azimuths are off is not known.</p>\n",
        );
    } else {
        html.push_str(&by_run(&errors, diagnosis));
        html.push_str(&by_heading(&errors));
    }
    html.push_str(&runs_table(diagnosis));
    html
}

fn errors(diagnosis: &Diagnosis) -> Vec<Error> {
    let error = |(run, it): (usize, &RunDiagnosis)| {
        it.error_before_deg.or(it.error_after_deg)?;
        Some(Error {
            run,
            heading_deg: wrap_360_deg(it.reference_azimuth_deg?),
            value_deg: [it.error_before_deg, it.error_after_deg],
            sigma_deg: [it.sigma_before_deg.unwrap_or_default(), it.sigma_after_deg.unwrap_or_default()],
        })
    };
    diagnosis.runs.iter().enumerate().filter_map(error).collect()
}

fn by_run(errors: &[Error], diagnosis: &Diagnosis) -> String {
    let known = |side: Side| errors.iter().filter_map(move |error| error.of(side));
    let largest = |side| known(side).map(|(value, sigma)| value.abs() + sigma).fold(0.0, f64::max);
    let enlarged = largest(Side::Before) > ENLARGE * largest(Side::After) && known(Side::After).count() > 0;
    let names: Vec<String> = diagnosis.runs.iter().map(|run| short_name(&run.file)).collect();
    let refused: Vec<usize> = (0..diagnosis.runs.len())
        .filter(|&i| diagnosis.runs[i].azimuth_before_deg.is_none() || diagnosis.runs[i].azimuth_after_deg.is_none())
        .collect();
    let draw = |canvas: Canvas| {
        let mut plots = vec![runs_plot(canvas, errors, &names, &refused, &Side::BOTH)];
        if enlarged {
            let mut plot = runs_plot(canvas, errors, &names, &refused, &[Side::After]);
            plot.corner("after, enlarged");
            plots.push(plot);
        }
        plots
    };
    let inside = |side| {
        let within = known(side).filter(|(value, sigma)| value.abs() <= 2.0 * sigma).count();
        format!("{within} of {}", known(side).count())
    };
    let mut caption = format!(
        "Azimuth minus reference; the bars are ± 1 sigma as the instrument reports it. Within 2 sigma of the reference: {} \
         before, {} after (95 % are to be expected of correct sigmas).",
        inside(Side::Before),
        inside(Side::After)
    );
    if !refused.is_empty() {
        let names: Vec<String> = refused.iter().map(|&run| escape(&names[run])).collect();
        caption.push_str(&format!(" Dotted lines: no azimuth before or after, runs {}.", names.join(", ")));
    }
    if errors.len() < diagnosis.runs.len() {
        caption.push_str(" Runs without marks were learned from, or have no reference.");
    }
    for side in Side::BOTH {
        let without = errors.len() - known(side).count();
        if without > 0 {
            let of_runs = counted(errors.len(), "run");
            caption.push_str(&format!(" Without an azimuth {}: {without} of {of_runs}.", side.name()));
        }
    }
    caption.push_str(&numbers(diagnosis));
    figure(Legend::Dots, "Azimuth error of each run before and after", &caption, draw)
}

/// All runs as a file.
fn numbers(diagnosis: &Diagnosis) -> String {
    let rows = diagnosis.runs.iter().map(|run| {
        let numbers = [
            run.reference_azimuth_deg,
            run.azimuth_before_deg,
            run.sigma_before_deg,
            run.azimuth_after_deg,
            run.sigma_after_deg,
            run.error_before_deg,
            run.error_after_deg,
        ];
        let role = if run.role == Role::Fit { "fit" } else { "check" };
        let numbers = numbers.map(|number| cell(number.unwrap_or(f64::NAN)));
        [run.file.clone(), role.to_owned()].into_iter().chain(numbers).chain([run.notes.join("; ")]).collect()
    });
    let head = [
        "run",
        "role",
        "reference_deg",
        "before_deg",
        "sigma_before_deg",
        "after_deg",
        "sigma_after_deg",
        "error_before_deg",
        "error_after_deg",
        "notes",
    ];
    csv("runs.csv", &head, rows)
}

fn runs_plot(canvas: Canvas, errors: &[Error], names: &[String], refused: &[usize], sides: &[Side]) -> Plot {
    let ends = errors.iter().flat_map(|error| {
        sides.iter().filter_map(|&side| error.of(side)).flat_map(|(value, sigma)| [value - sigma, value + sigma])
    });
    let y = Axis::linear("azimuth error, °", ends.chain([0.0]));
    let x = Axis::exact("run", -0.6, names.len() as f64 - 0.4);
    let mut plot = Plot::new(canvas.width, if canvas.narrow { 250.0 } else { 270.0 }, x, y);
    let room = plot.frame_width() / (names.len() as f64 + 0.2);
    let every = (34.0 / room).ceil().max(1.0) as usize;
    plot.x_ticks(names.iter().enumerate().step_by(every).map(|(i, name)| (i as f64, name.clone())).collect());
    plot.level("zero", 0.0);
    refused.iter().for_each(|&run| plot.upright("split", run as f64));
    let shift = if sides.len() > 1 { (5.0 / room).min(0.25) } else { 0.0 };
    for &side in sides {
        let x = |run: usize| run as f64 + if side == Side::Before { -shift } else { shift };
        let marks = || errors.iter().filter_map(|error| Some((x(error.run), error.of(side)?)));
        plot.bars(
            &format!("bar {}", side.name()),
            marks().map(|(x, (value, sigma))| (x, value - sigma, value + sigma)),
        );
        plot.dots(side, marks().map(|(x, (value, _))| (x, value)));
    }
    plot
}

fn by_heading(errors: &[Error]) -> String {
    let first = errors.first().map_or(0.0, |error| error.heading_deg);
    let spread = errors.iter().map(|error| wrap_180_deg(error.heading_deg - first).abs()).fold(0.0, f64::max);
    if errors.len() < 4 || spread < HEADINGS_DEG {
        return String::new();
    }
    let draw = |canvas: Canvas| {
        let y =
            Axis::linear("azimuth error, °", errors.iter().flat_map(|error| error.value_deg).flatten().chain([0.0]));
        let mut plot = Plot::new(canvas.width, 240.0, Axis::exact("azimuth of the mark, °", -8.0, 368.0), y);
        let step = if canvas.narrow { 90 } else { 45 };
        plot.x_ticks((0..=360).step_by(step).map(|angle| (angle.into(), angle.to_string())).collect());
        plot.level("zero", 0.0);
        for side in Side::BOTH {
            plot.dots(side, errors.iter().filter_map(|error| Some((error.heading_deg, error.of(side)?.0))));
        }
        vec![plot]
    };
    let caption = "The same errors against the heading: a field fixed to the body, to the Earth, or a rate that is not linear \
                   shows here and nowhere else.";
    figure(Legend::Dots, "Azimuth error against heading before and after", caption, draw)
}

fn runs_table(diagnosis: &Diagnosis) -> String {
    let head = [
        ("run", false),
        ("role", false),
        ("before, °", true),
        ("after, °", true),
        ("reference, °", true),
        ("flags after, notes", false),
    ];
    let azimuth = |value: Option<f64>, sigma| value.map_or("–".to_owned(), |value| with_sigma(value, sigma));
    let row = |run: &RunDiagnosis| {
        let notes = run.flags_after.iter().map(|flag| flag.replace('_', " ")).chain(run.notes.iter().cloned());
        vec![
            escape(&run.file),
            if run.role == Role::Fit { "fit" } else { "check" }.to_owned(),
            azimuth(run.azimuth_before_deg, run.sigma_before_deg),
            azimuth(run.azimuth_after_deg, run.sigma_after_deg),
            run.reference_azimuth_deg.map_or("–".to_owned(), short),
            escape(&notes.collect::<Vec<_>>().join("; ")),
        ]
    };
    let rows: Vec<_> = diagnosis.runs.iter().map(row).collect();
    let all = counted(rows.len(), "run");
    format!("<details open><summary>All in numbers: {all}</summary>\n{}</details>\n", table(&head, &rows))
}

/// What a run is called below a plot: its file's name without folder, extension and leading zeros.
fn short_name(file: &str) -> String {
    let stem = Path::new(file).file_stem().map_or_else(|| file.into(), |stem| stem.to_string_lossy());
    match stem.trim_start_matches('0') {
        "" => "0".into(),
        name if name.chars().count() > 8 => name.chars().take(7).chain(['…']).collect(),
        name => name.into(),
    }
}

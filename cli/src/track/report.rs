//! The page of `north track --report`: heading, its error and sigma, and whether the innovations are as large as they should be.

use std::path::Path;

use super::{Detail, Innovations, Track, TrackRow};
use crate::diagnose::report::{Axis, Canvas, Legend, Plot, Side, escape, figure, page};

/// Seconds whose innovations make one mean.
const BIN_S: f64 = 60.0;
/// More points than this are thinned: one for each pixel.
const POINTS: usize = 800;
const HEIGHT: f64 = 240.0;

/// The whole page; `summary` is what the command printed.
pub fn html(file: &Path, summary: &str, track: &Track) -> String {
    let rows = &track.rows;
    let name = file.display().to_string();
    let title = format!("Track of {name}");
    let body = format!(
        "<h1>{}</h1>\n<p>{}</p>\n{}{}{}{}{}",
        escape(&title),
        escape(summary).replace('\n', "<br>"),
        headings(rows),
        sigmas(rows),
        errors(rows),
        positions(rows),
        innovations(track)
    );
    page(&title, &body)
}

fn thinned(rows: &[TrackRow]) -> impl Iterator<Item = &TrackRow> + Clone {
    rows.iter().step_by(rows.len().div_ceil(POINTS).max(1))
}

fn time(rows: &[TrackRow]) -> Axis {
    let end = |row: Option<&TrackRow>| row.map_or(0.0, |row| row.t_s);
    Axis::exact("time, s", end(rows.first()), end(rows.last()).max(end(rows.first()) + 1.0))
}

fn curve(canvas: Canvas, rows: &[TrackRow], label: &str, of: fn(&TrackRow) -> f64) -> Plot {
    let points = thinned(rows).map(|row| (row.t_s, of(row)));
    let mut plot =
        Plot::new(canvas.width, HEIGHT, time(rows), Axis::linear(label, points.clone().map(|point| point.1)));
    plot.line("line after", points);
    plot
}

fn headings(rows: &[TrackRow]) -> String {
    figure(Legend::None, "heading over time", "Heading, clockwise from true north.", |canvas| {
        vec![curve(canvas, rows, "heading, °", |row| row.angles.heading_deg)]
    })
}

fn sigmas(rows: &[TrackRow]) -> String {
    figure(Legend::None, "sigma of the heading over time", "One standard deviation of the heading.", |canvas| {
        vec![curve(canvas, rows, "sigma, °", |row| row.sigma_heading_deg)]
    })
}

/// Nothing where nothing is compared with.
fn errors(rows: &[TrackRow]) -> String {
    let compared = || thinned(rows).filter_map(|row| Some((row.t_s, row.error_deg?, 1.96 * row.sigma_heading_deg)));
    if compared().next().is_none() {
        return String::new();
    }
    figure(
        Legend::Named(&[("line after", "error"), ("reference", "± 1.96 sigma")]),
        "error of the heading over time",
        "Heading less the reference; 95 % of independent errors lie between the dashed lines.",
        |canvas| {
            let values = compared().flat_map(|(_, error, band)| [error, band, -band]);
            let mut plot = Plot::new(canvas.width, HEIGHT, time(rows), Axis::linear("error, °", values));
            plot.line("line after", compared().map(|(t_s, error, _)| (t_s, error)));
            plot.line("reference", compared().map(|(t_s, _, band)| (t_s, band)));
            plot.line("reference", compared().map(|(t_s, _, band)| (t_s, -band)));
            vec![plot]
        },
    )
}

/// Errors of the position beside its sigma, where there is an aided track and a reference.
fn positions(rows: &[TrackRow]) -> String {
    let compared = || {
        thinned(rows).filter_map(|row| match row.detail {
            Detail::Aided { position_error_m: Some(error), sigma_position_m, .. } => {
                Some((row.t_s, error, 1.96 * sigma_position_m))
            }
            _ => None,
        })
    };
    if compared().next().is_none() {
        return String::new();
    }
    figure(
        Legend::Named(&[("line after", "error"), ("reference", "1.96 sigma")]),
        "error of the position over time",
        "Distance from the reference; sigma is that of east and north together.",
        |canvas| {
            let values = compared().flat_map(|(_, error, band)| [error, band, 0.0]);
            let mut plot = Plot::new(canvas.width, HEIGHT, time(rows), Axis::linear("position error, m", values));
            plot.line("line after", compared().map(|(t_s, error, _)| (t_s, error)));
            plot.line("reference", compared().map(|(t_s, _, band)| (t_s, band)));
            vec![plot]
        },
    )
}

/// Mean normalised squared innovation of a minute, with half the width of the interval that holds 95 % of such means: that of
/// a chi-square with m degrees of freedom over m, 1.96 √(2/m).
fn minutes(source: &Innovations) -> Vec<(f64, f64, f64)> {
    let mut bins: Vec<(f64, f64, f64)> = Vec::new();
    for (t_s, squares, number) in &source.taken {
        let start_s = (t_s / BIN_S).floor() * BIN_S;
        if bins.last().is_none_or(|bin| bin.0 < start_s) {
            bins.push((start_s, 0.0, 0.0));
        }
        if let Some((_, sum, count)) = bins.last_mut() {
            *sum += squares;
            *count += f64::from(*number);
        }
    }
    bins.into_iter()
        .map(|(start_s, squares, m)| (start_s + 0.5 * BIN_S, squares / m, 1.96 * (2.0 / m).sqrt()))
        .collect()
}

fn innovations(track: &Track) -> String {
    let sources: Vec<(&Innovations, Vec<_>)> =
        track.innovations.iter().map(|source| (source, minutes(source))).filter(|(_, all)| !all.is_empty()).collect();
    if sources.is_empty() {
        return "<p>There are no innovations: the block never stood, and no reading was taken.</p>\n".into();
    }
    figure(
        Legend::Named(&[
            ("line after", "mean of a minute"),
            ("reference", "95 % of such means"),
            ("line before", "rejected"),
        ]),
        "normalised innovations over time",
        "Squares of the innovations over their variances, mean of each minute (NIS), a drawing for each source: 1 where sigmas are right. \
         Upright lines: readings that were rejected.",
        |canvas| {
            let drawing = |(source, minutes): &(&Innovations, Vec<(f64, f64, f64)>)| {
                let values = minutes.iter().flat_map(|(_, mean, half)| [*mean, (1.0 - half).max(0.0), 1.0 + half]);
                let label = format!("NIS, {}", source.name);
                let mut plot = Plot::new(canvas.width, HEIGHT, time(&track.rows), Axis::linear(label, values));
                source.rejected_s.iter().for_each(|t_s| plot.upright("line before", *t_s));
                plot.bars("reference", minutes.iter().map(|(t_s, _, half)| (*t_s, 1.0 - half, 1.0 + half)));
                plot.line("line after", minutes.iter().map(|(t_s, mean, _)| (*t_s, *mean)));
                plot.dots(Side::After, minutes.iter().map(|(t_s, mean, _)| (*t_s, *mean)));
                plot
            };
            sources.iter().map(drawing).collect()
        },
    )
}

//! The page of `north track --report`: heading, its error and sigma, and whether the innovations are as large as they should be.

use std::path::Path;

use north_finder::attitude::hold::HoldSecond;

use crate::diagnose::report::{Axis, Canvas, Legend, Plot, Side, escape, figure, page};

/// Seconds whose innovations make one mean.
const BIN_S: f64 = 60.0;
/// More points than this are thinned: one for each pixel.
const POINTS: usize = 800;
const HEIGHT: f64 = 240.0;

/// A second of the track.
#[derive(Clone, Copy, Debug)]
pub struct TrackRow {
    pub t_s: f64,
    pub second: HoldSecond,
    /// Heading less its reference, degrees.
    pub error_deg: Option<f64>,
}

/// The whole page; `summary` is what the command printed.
pub fn html(file: &Path, summary: &str, rows: &[TrackRow]) -> String {
    let name = file.display().to_string();
    let title = format!("Track of {name}");
    let body = format!(
        "<h1>{}</h1>\n<p>{}</p>\n{}{}{}{}",
        escape(&title),
        escape(summary),
        headings(rows),
        sigmas(rows),
        errors(rows),
        innovations(rows)
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
        vec![curve(canvas, rows, "heading, °", |row| row.second.angles.heading_deg)]
    })
}

fn sigmas(rows: &[TrackRow]) -> String {
    figure(Legend::None, "sigma of the heading over time", "One standard deviation of the heading.", |canvas| {
        vec![curve(canvas, rows, "sigma, °", |row| row.second.sigma_heading_deg)]
    })
}

/// Nothing where nothing is compared with.
fn errors(rows: &[TrackRow]) -> String {
    let compared =
        || thinned(rows).filter_map(|row| Some((row.t_s, row.error_deg?, 1.96 * row.second.sigma_heading_deg)));
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

/// Mean normalised squared innovation of a minute, with half the width of the interval that holds 95 % of such means: that of
/// a chi-square with m degrees of freedom over m, 1.96 √(2/m).
fn minutes(rows: &[TrackRow]) -> Vec<(f64, f64, f64)> {
    let mut bins: Vec<(f64, f64, f64)> = Vec::new();
    for row in rows.iter().filter(|row| row.second.degrees_of_freedom > 0) {
        let start_s = (row.t_s / BIN_S).floor() * BIN_S;
        if bins.last().is_none_or(|bin| bin.0 < start_s) {
            bins.push((start_s, 0.0, 0.0));
        }
        if let Some((_, squares, count)) = bins.last_mut() {
            *squares += row.second.normalised_squared;
            *count += f64::from(row.second.degrees_of_freedom);
        }
    }
    bins.into_iter()
        .map(|(start_s, squares, m)| (start_s + 0.5 * BIN_S, squares / m, 1.96 * (2.0 / m).sqrt()))
        .collect()
}

fn innovations(rows: &[TrackRow]) -> String {
    let minutes = minutes(rows);
    if minutes.is_empty() {
        return "<p>The block never stood: there are no innovations.</p>\n".into();
    }
    figure(
        Legend::Named(&[("line after", "mean of a minute"), ("reference", "95 % of such means")]),
        "normalised innovations over time",
        "Squares of the innovations over their variances, mean of each minute (NIS): 1 where sigmas are right.",
        |canvas| {
            let values = minutes.iter().flat_map(|(_, mean, half)| [*mean, 1.0 - half, 1.0 + half]);
            let mut plot = Plot::new(canvas.width, HEIGHT, time(rows), Axis::linear("NIS", values));
            plot.bars("reference", minutes.iter().map(|(t_s, _, half)| (*t_s, 1.0 - half, 1.0 + half)));
            plot.line("line after", minutes.iter().map(|(t_s, mean, _)| (*t_s, *mean)));
            plot.dots(Side::After, minutes.iter().map(|(t_s, mean, _)| (*t_s, *mean)));
            vec![plot]
        },
    )
}

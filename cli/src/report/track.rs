//! The page of `north track --report`: heading, its error and sigma, and whether the innovations are as large as they should be.

use std::path::Path;

use north_finder::earth::SEMI_MAJOR_M;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg};

use super::{Axis, Canvas, Legend, Plot, Side, escape, figure, head, number, page, tile};
use crate::track::{Detail, Innovations, Track, TrackRow};

/// Seconds whose innovations make one mean.
const BIN_S: f64 = 60.0;
/// More points than this are thinned: one for each pixel.
const POINTS: usize = 800;
const HEIGHT: f64 = 240.0;

/// The whole page; `summary` is what the command printed.
pub fn html(file: &Path, summary: &str, track: &Track) -> String {
    let rows = &track.rows;
    let title = format!("Track of {}", file.display());
    let result = rows.last().map_or("No second of the recording has a heading".to_owned(), |row| {
        format!("Heading at the end {:.4}° ± {:.4}°", row.angles.heading_deg, row.sigma_heading_deg)
    });
    let body = [
        head(&title, &[], &result),
        tiles(track),
        map(rows),
        headings(rows),
        sigmas(rows),
        errors(rows),
        positions(rows),
        innovations(track),
        format!("<details><summary>What the command printed</summary>\n<pre>{}</pre></details>\n", escape(summary)),
    ];
    page(&title, &body.concat())
}

/// Half the width of the interval that holds 95 % of means of m squares of normal numbers: that of a chi-square with m degrees of freedom over m.
fn half_width(m: f64) -> f64 {
    1.96 * (2.0 / m).sqrt()
}

/// The few numbers that carry the result.
fn tiles(track: &Track) -> String {
    let mut html = String::from("<div class=\"tiles\">\n");
    if let Some((rms, within)) = track.errors() {
        let note = format!("{:.1} % within 1.96 sigma; 95 % are to be expected", 100.0 * within);
        html += &tile("Error of the heading, rms", &format!("{}°", number(rms, 3)), &note);
    }
    let (nis, count) = track.nis();
    if count > 0 {
        let half = half_width(f64::from(count));
        let note = match nis {
            nis if nis > 1.0 + half => format!(
                "above 1 ± {half:.3}, which holds 95 %: the sigmas are too small, or not all errors are modelled"
            ),
            nis if nis < 1.0 - half => {
                format!("below 1 ± {half:.3}, which holds 95 %: the sigmas are larger than the errors")
            }
            _ => format!("within 1 ± {half:.3}, which holds 95 %"),
        };
        html += &tile("Normalised innovations squared, mean", &number(nis, 3), &note);
    }
    html + "</div>\n"
}

/// Where the track went, east and north of its beginning.
fn map(rows: &[TrackRow]) -> String {
    let place = |row: &TrackRow| match row.detail {
        Detail::Aided { latitude_deg, longitude_deg, .. } => Some((latitude_deg, longitude_deg)),
        Detail::Held { .. } => None,
    };
    let Some((latitude_deg, longitude_deg)) = rows.iter().find_map(place) else { return String::new() };
    // A drawing: on a sphere is good enough.
    let metres = SEMI_MAJOR_M * RAD_PER_DEG;
    let east = metres * latitude_deg.to_radians().cos();
    let points: Vec<(f64, f64)> = thinned(rows)
        .filter_map(place)
        .map(|(lat, lon)| (east * wrap_180_deg(lon - longitude_deg), metres * (lat - latitude_deg)))
        .collect();
    figure(
        Legend::Marks(&[(Side::Before, "begin"), (Side::After, "end")]),
        "map of the track",
        "Where it went, from above, north upwards; one scale for both axes.",
        |canvas| {
            let height = 0.62 * canvas.width;
            let span = |of: fn(&(f64, f64)) -> f64| {
                let all = || points.iter().map(of);
                let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
                (0.5 * (low + high), high - low)
            };
            let ((x, wide), (y, tall)) = (span(|point| point.0), span(|point| point.1));
            // Frame and drawing differ by the room of the labels: 60 and 70 pixels.
            let scale = 1.1 * f64::max((wide / (canvas.width - 60.0)).max(tall / (height - 70.0)), 1e-3);
            let (half_x, half_y) = (0.5 * scale * (canvas.width - 60.0), 0.5 * scale * (height - 70.0));
            let axis = |label, middle: f64, half: f64| Axis::exact(label, middle - half, middle + half);
            let mut plot = Plot::new(canvas.width, height, axis("east, m", x, half_x), axis("north, m", y, half_y));
            plot.line("line after", points.iter().copied());
            plot.dots(Side::Before, points.first().copied());
            plot.dots(Side::After, points.last().copied());
            vec![plot]
        },
    )
}

fn thinned(rows: &[TrackRow]) -> impl Iterator<Item = &TrackRow> + Clone {
    let step = rows.len().div_ceil(POINTS).max(1);
    let rest = rows.last().filter(|_| !(rows.len() - 1).is_multiple_of(step));
    rows.iter().step_by(step).chain(rest)
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

/// Mean normalised squared innovation of each minute, with half the width of the interval that holds 95 % of such means.
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
    bins.into_iter().map(|(start_s, squares, m)| (start_s + 0.5 * BIN_S, squares / m, half_width(m))).collect()
}

fn innovations(track: &Track) -> String {
    let sources: Vec<(&Innovations, Vec<_>)> =
        track.innovations.iter().map(|source| (source, minutes(source))).filter(|(_, all)| !all.is_empty()).collect();
    if sources.is_empty() {
        return "<p>There are no innovations: the block never stood, and no reading was taken.</p>\n".into();
    }
    let (outside, minutes) = sources
        .iter()
        .flat_map(|(_, minutes)| minutes)
        .fold((0, 0), |(outside, all), (_, mean, half)| (outside + usize::from((mean - 1.0).abs() > *half), all + 1));
    let rejected: usize = sources.iter().map(|(source, _)| source.rejected_s.len()).sum();
    let caption = format!(
        "Squares of the innovations over their variances, mean of each minute (NIS), a drawing for each source: 1 where the sigmas are right. Grey dashed bars hold 95 % of \
         such means; {outside} of {minutes} means are outside of theirs. Orange upright lines: readings that were rejected, {rejected}."
    );
    figure(
        Legend::Named(&[
            ("line after", "mean of a minute"),
            ("reference", "holds 95 % of such means"),
            ("line before", "reading rejected"),
        ]),
        "normalised innovations over time",
        &caption,
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

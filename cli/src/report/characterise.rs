//! The page of `north characterise --report`: the Allan deviation with the parts that it is made of.

use std::path::Path;

use super::{Axis, Legend, Plot, Side, escape, figure, head, number, page, table, tile};
use crate::characterise::{Channels, Character, PROCESSES, Suggested, told};

const HEIGHT: f64 = 380.0;
/// Points of a curve.
const POINTS: usize = 120;
/// Class of a line and what the legend says.
type Line = (&'static str, &'static str);
const TOGETHER: Line = ("line after", "the parts together");
/// In the order of [`PROCESSES`].
const PARTS: [Line; PROCESSES.len()] = [
    ("part quantisation", "quantisation"),
    ("part walk", "angle random walk"),
    ("part flicker", "bias instability"),
    ("part drift", "rate random walk"),
    ("part ramp", "rate ramp"),
];
const WITHOUT_CHANNELS: Line = ("part channels", "measured, without what the channels do");

/// The whole page.
pub fn html(recording: &Path, character: &Character, channels: Option<&Channels>, settings: &Suggested) -> String {
    let title = format!("Noise of a gyro: {}", recording.display());
    let recorded = format!("{:.0} s at {} s a row", character.seconds, character.interval_s);
    let about: Vec<String> = std::iter::once(recorded).chain(told(&character.outliers)).collect();
    let walk = character.noise.angle_random_walk_deg_per_sqrt_h;
    let result = match walk > 0.0 {
        true => format!("Angle random walk {} °/√h", number(walk, 3)),
        false => "No angle random walk is seen in this recording".to_owned(),
    };
    let body = [
        head(&title, &about, &result),
        tiles(character),
        deviation(character, channels),
        coefficients(character),
        deviations_table(character),
        format!(
            "<h2>Settings that follow</h2>\n<p>For <code>--settings</code> and <code>north settings restore</code>:</p>\n<pre>{}</pre>\n",
            escape(&settings.to_toml())
        ),
    ];
    page(&title, &body.concat())
}

fn tiles(character: &Character) -> String {
    let (correlation, sigma) = (character.autocorrelation_1s, character.autocorrelation_sigma);
    let quantum = character.quantum_arcsec.map_or("no common count is seen".to_owned(), |quantum| {
        format!("increments are counts of {} arcsec", number(quantum, 4))
    });
    [
        tile(
            "Mean rate",
            &format!("{} °/h", number(character.mean_deg_h, 5)),
            "bias and the Earth's rate along the axis",
        ),
        tile(
            "Correlation of neighbouring seconds",
            &format!("{} ± {}", number(correlation, 2), number(sigma, 2)),
            &format!("{}; {quantum}", character.correlation_verdict()),
        ),
        tile(
            "Largest change in a second",
            &format!("{} °/h", number(character.largest_change_deg_h, 3)),
            "between neighbouring one-second rates; the gates' thresholds follow from it",
        ),
    ]
    .concat()
    .replacen("<div class=\"tile\">", "<div class=\"tiles\">\n<div class=\"tile\">", 1)
        + "</div>\n"
}

fn deviation(character: &Character, channels: Option<&Channels>) -> String {
    let points = &character.allan;
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return String::new() };
    let taus = || (0..POINTS).map(|i| first.tau_s * (last.tau_s / first.tau_s).powf(i as f64 / (POINTS - 1) as f64));
    let noise = character.noise;
    let seen: Vec<(usize, Line)> = PARTS
        .into_iter()
        .enumerate()
        .filter(|(process, _)| noise.deviations_deg_h(first.tau_s)[*process] > 0.0)
        .collect();
    let draw = |canvas: super::Canvas| {
        let ends = points.iter().flat_map(|point| {
            let spread = point.relative.min(0.9) * point.sigma_deg_h;
            [point.sigma_deg_h - spread, point.sigma_deg_h + spread]
        });
        // A part that the legend names is in the frame at least where it is greatest.
        let greatest = |&(process, _): &(usize, Line)| {
            0.9 * taus().map(|tau_s| noise.deviations_deg_h(tau_s)[process]).fold(f64::MIN_POSITIVE, f64::max)
        };
        let ends = ends.chain(seen.iter().map(greatest));
        let x = Axis::logarithmic("averaging time, s", points.iter().map(|point| point.tau_s));
        let mut plot = Plot::new(canvas.width, HEIGHT, x, Axis::logarithmic("Allan deviation, °/h", ends));
        for &(process, (class, _)) in &seen {
            plot.line(class, taus().map(|tau_s| (tau_s, noise.deviations_deg_h(tau_s)[process])));
        }
        let together = |tau_s: f64| noise.deviations_deg_h(tau_s).iter().map(|part| part * part).sum::<f64>().sqrt();
        plot.line(TOGETHER.0, taus().map(|tau_s| (tau_s, together(tau_s))));
        if let Some(channels) = channels {
            plot.line(WITHOUT_CHANNELS.0, channels.left.iter().map(|point| (point.tau_s, point.sigma_deg_h)));
        }
        plot.bars(
            "bar before",
            points.iter().map(|point| {
                let spread = point.relative.min(0.9) * point.sigma_deg_h;
                (point.tau_s, point.sigma_deg_h - spread, point.sigma_deg_h + spread)
            }),
        );
        plot.dots(Side::Before, points.iter().map(|point| (point.tau_s, point.sigma_deg_h)));
        vec![plot]
    };
    let parts = seen.iter().map(|(_, part)| *part);
    let legend: Vec<Line> = std::iter::once(TOGETHER).chain(parts).chain(channels.map(|_| WITHOUT_CHANNELS)).collect();
    figure(
        Legend::Named(&legend),
        "Allan deviation over the averaging time, with its parts",
        "Overlapping Allan deviation: circles are measured, with ± 1 sigma of the estimate itself. Lines are the noise processes of IEEE Std 952 that were \
         found; a part that is not drawn is not seen in this recording.",
        draw,
    )
}

fn coefficients(character: &Character) -> String {
    let rows: Vec<Vec<String>> = PROCESSES
        .iter()
        .zip(character.noise.coefficients())
        .map(|((name, letter, unit), value)| {
            let value = if value > 0.0 { number(value, 3) } else { "not seen in this recording".into() };
            vec![format!("{name}, {letter}"), value, (*unit).to_owned()]
        })
        .collect();
    format!("<h2>Parts</h2>\n{}", table(&[("process", false), ("coefficient", true), ("unit", false)], &rows))
}

fn deviations_table(character: &Character) -> String {
    let rows: Vec<Vec<String>> = character
        .allan
        .iter()
        .map(|point| {
            vec![number(point.tau_s, 4), number(point.sigma_deg_h, 4), format!("{:.0} %", 100.0 * point.relative)]
        })
        .collect();
    let head = [("averaging time, s", true), ("Allan deviation, °/h", true), ("one sigma of it", true)];
    format!("<details><summary>All {} deviations in numbers</summary>\n{}</details>\n", rows.len(), table(&head, &rows))
}

//! The page of `north align --report`: the heading of every window with its sigma, with the latitude and without it.

use std::path::Path;

use north_finder::units::wrap_180_deg;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Axis, Legend, Plot, Side, escape, figure, page, table};
use crate::block_gate::Gated;
use crate::count::counted;

const HEIGHT: f64 = 220.0;

/// Whether the latitude was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    KnownLatitude,
    UnknownLatitude,
}

impl Method {
    pub const ALL: [Self; 2] = [Self::KnownLatitude, Self::UnknownLatitude];

    pub fn name(self) -> &'static str {
        match self {
            Self::KnownLatitude => "inertial-least-squares",
            Self::UnknownLatitude => "inertial-unknown-latitude",
        }
    }
}

/// The result of the whole recording, and of every window.
#[derive(Serialize, JsonSchema)]
pub struct Report {
    pub heading_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
    pub sigma_heading_deg: f64,
    pub method: &'static str,
    pub latitude_deg: f64,
    pub arw_deg_per_sqrt_h: f64,
    pub rate_excess_deg_h: f64,
    /// Of the base's attitude, one sigma: to and fro, random walk, steady drift.
    pub base_jitter_arcsec: f64,
    pub base_walk_arcsec_per_sqrt_s: f64,
    pub base_drift_deg_h: f64,
    /// One sigma of the drift by the accelerometers alone: a lesser one is not seen.
    pub unseen_drift_deg_h: f64,
    /// Heading error that a drift of that size makes where it is not seen, degrees.
    pub unseen_drift_heading_deg: f64,
    pub outliers: Gated,
    /// Gaps of the recording: heading and levels are of its longest part without one.
    pub gaps: usize,
    /// Begin and end of that part.
    pub used_s: [f64; 2],
    /// How long the recording lasts.
    pub recording_s: f64,
    pub windows: Vec<Window>,
}

impl Report {
    /// Which part of the recording heading and levels are of, in a sentence; `None` where it is the whole one.
    pub fn said_of_gaps(&self) -> Option<String> {
        let [from_s, to_s] = self.used_s;
        (self.gaps > 0).then(|| {
            format!(
                "{}; heading and levels are of the longest part without one, {from_s:.1} to {to_s:.1} s of {:.1} s",
                counted(self.gaps, "gap"),
                self.recording_s
            )
        })
    }
}

/// One method on one window.
#[derive(Serialize, JsonSchema)]
pub struct Window {
    pub start_s: f64,
    pub seconds: f64,
    pub method: &'static str,
    pub heading_deg: Option<f64>,
    pub sigma_heading_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// The whole page; headings are drawn from the reference, or from that of the whole recording.
pub fn html(file: &Path, report: &Report, reference_deg: Option<f64>) -> String {
    let title = format!("Alignment of {}", file.display());
    let zero_deg = reference_deg.unwrap_or(report.heading_deg);
    let from = if reference_deg.is_some() { "the reference" } else { "the whole recording's" };
    let figures: String = Method::ALL.iter().map(|method| of_method(report, method.name(), zero_deg, from)).collect();
    let rows: Vec<Vec<String>> = report
        .windows
        .iter()
        .map(|window| {
            let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.4}"));
            vec![
                format!("{:.1}", window.start_s),
                format!("{:.1}", window.seconds),
                window.method.to_owned(),
                number(window.heading_deg),
                number(window.sigma_heading_deg),
                escape(window.reason.as_deref().unwrap_or("")),
            ]
        })
        .collect();
    let head = [
        ("start, s", true),
        ("seconds", true),
        ("method", false),
        ("heading, °", true),
        ("sigma, °", true),
        ("refused because", false),
    ];
    let body = format!(
        "<h1>{}</h1>\n<p>Heading {:.4}° ± {:.4}°, pitch {:.4}°, roll {:.4}° at the end, by {}; latitude {:.3}°, noise of the gyros \
         {:.5} °/√h, horizontal rate {:+.4} °/h against the Earth's. The base: jitter \
         {:.3}″, random walk {:.3} ″/√s, drift {:.4} °/h, one sigma each; a drift of {:.4} °/h would not be seen, and turn the heading by {:.4}°; {}{}.</p>\n{figures}<h2>Windows</h2>\n{}",
        escape(&title),
        report.heading_deg,
        report.sigma_heading_deg,
        report.pitch_deg,
        report.roll_deg,
        report.method,
        report.latitude_deg,
        report.arw_deg_per_sqrt_h,
        report.rate_excess_deg_h,
        report.base_jitter_arcsec,
        report.base_walk_arcsec_per_sqrt_s,
        report.base_drift_deg_h,
        report.unseen_drift_deg_h,
        report.unseen_drift_heading_deg,
        report.outliers,
        report.said_of_gaps().map_or_else(String::new, |said| format!("; {said}")),
        table(&head, &rows)
    );
    page(&title, &body)
}

/// Nothing where every window refused.
fn of_method(report: &Report, method: &str, zero_deg: f64, from: &str) -> String {
    let points: Vec<(f64, f64, f64)> = report
        .windows
        .iter()
        .filter(|window| window.method == method)
        .filter_map(|window| {
            let off = wrap_180_deg(window.heading_deg? - zero_deg);
            Some((window.start_s + 0.5 * window.seconds, off, 1.96 * window.sigma_heading_deg?))
        })
        .collect();
    if points.is_empty() {
        return String::new();
    }
    let caption = format!("Headings of the windows by {method} less {from}, {zero_deg:.4}°, with 1.96 sigma.");
    figure(Legend::None, &format!("headings by {method}"), &caption, |canvas| {
        let x = Axis::linear("middle of the window, s", points.iter().map(|point| point.0));
        let y =
            Axis::linear(format!("{method}, °"), points.iter().flat_map(|(_, off, bar)| [0.0, off - bar, off + bar]));
        let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
        plot.level("reference", 0.0);
        plot.bars("bar after", points.iter().map(|(t_s, off, bar)| (*t_s, off - bar, off + bar)));
        plot.dots(Side::After, points.iter().map(|(t_s, off, _)| (*t_s, *off)));
        vec![plot]
    })
}

//! The page of `north track --report`: heading, its sigma and its error over time. No scripts, nothing fetched.

use std::fmt::Write;
use std::path::Path;

use north_finder::attitude::hold::HoldSecond;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 220.0;
const MARGIN: f64 = 60.0;

/// A second of the track.
#[derive(Clone, Copy, Debug)]
pub struct TrackRow {
    pub t_s: f64,
    pub second: HoldSecond,
    /// Heading less its reference, degrees.
    pub error_deg: Option<f64>,
}

/// The whole page.
pub fn html(file: &Path, class: &str, rows: &[TrackRow]) -> String {
    let name = file.display().to_string().replace('&', "&amp;").replace('<', "&lt;");
    let heading = rows.iter().map(|row| (row.t_s, row.second.angles.heading_deg)).collect::<Vec<_>>();
    let sigma = rows.iter().map(|row| (row.t_s, row.second.sigma_heading_deg)).collect::<Vec<_>>();
    let errors = rows.iter().filter_map(|row| Some((row.t_s, row.error_deg?))).collect::<Vec<_>>();
    let mut plots = plot("Heading, °", &[&heading]) + &plot("Sigma of the heading, °", &[&sigma]);
    if !errors.is_empty() {
        let band = |sign: f64| {
            let with_error = rows.iter().filter(|row| row.error_deg.is_some());
            with_error.map(|row| (row.t_s, sign * 1.96 * row.second.sigma_heading_deg)).collect::<Vec<_>>()
        };
        plots += &plot("Error of the heading and ± 1.96 sigma, °", &[&errors, &band(1.0), &band(-1.0)]);
    }
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{name}: track</title>\n<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:auto;\
         padding:1rem}}svg{{width:100%;height:auto}}text{{font:12px sans-serif;fill:currentColor}}\
         polyline{{fill:none;stroke:#2a78c2}}polyline+polyline{{stroke:#999}}rect{{fill:none;stroke:#999}}</style>\n\
         </head>\n<body>\n<h1>Track of {name}</h1>\n<p>Class of the block: {class}; {} seconds.</p>\n{plots}</body>\n\
         </html>\n",
        rows.len()
    )
}

/// Curves over time in one frame; the first is drawn strongest.
fn plot(title: &str, curves: &[&[(f64, f64)]]) -> String {
    let all = || curves.iter().flat_map(|curve| curve.iter()).copied();
    let range = |of: fn((f64, f64)) -> f64| {
        let (low, high) = all()
            .map(of)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if high > low { (low, high) } else { (low - 0.5, low + 0.5) }
    };
    let ((t0, t1), (y0, y1)) = (range(|point| point.0), range(|point| point.1));
    let x = |t_s: f64| MARGIN + (t_s - t0) / (t1 - t0) * (WIDTH - MARGIN - 10.0);
    let y = |value: f64| 20.0 + (y1 - value) / (y1 - y0) * (HEIGHT - 50.0);
    let mut svg = format!(
        "<figure><figcaption>{title}</figcaption><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
         aria-label=\"{title}\"><rect x=\"{MARGIN}\" y=\"20\" width=\"{}\" height=\"{}\"/>",
        WIDTH - MARGIN - 10.0,
        HEIGHT - 50.0
    );
    for curve in curves {
        // A point a pixel is enough.
        let step = (curve.len() / 900).max(1);
        let points: Vec<String> =
            curve.iter().step_by(step).map(|(t_s, value)| format!("{:.1},{:.1}", x(*t_s), y(*value))).collect();
        let _ = write!(svg, "<polyline points=\"{}\"/>", points.join(" "));
    }
    let _ = writeln!(
        svg,
        "<text x=\"4\" y=\"30\">{y1:.4}</text><text x=\"4\" y=\"{}\">{y0:.4}</text><text x=\"{MARGIN}\" y=\"{}\">{t0:.0} \
         s</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{t1:.0} s</text></svg></figure>",
        HEIGHT - 32.0,
        HEIGHT - 12.0,
        WIDTH - 10.0,
        HEIGHT - 12.0
    );
    svg
}

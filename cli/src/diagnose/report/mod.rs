//! The report: one self-contained HTML page about a diagnosis. No scripts, nothing fetched, light and dark, any width.

mod abscissa;
mod axis;
mod download;
mod dwells;
mod errors;
mod figure;
mod findings;
mod html;
mod plot;
mod residuals;
mod summary;

use super::Diagnosis;

pub use self::axis::Axis;
pub use self::figure::{Canvas, Legend, figure};
pub use self::html::{escape, table};
pub use self::plot::{Plot, Side};

const STYLE: &str = include_str!("style.css");

/// The whole page. Every figure is drawn twice, for wide and for narrow screens; the style sheet shows one of them.
pub fn html(diagnosis: &Diagnosis) -> String {
    let title = diagnosis.title.as_deref().unwrap_or("Campaign");
    let sections = [
        summary::section(diagnosis),
        errors::section(diagnosis),
        findings::effects(diagnosis),
        dwells::section(diagnosis),
        residuals::section(diagnosis),
        findings::candidates(diagnosis),
        findings::noise(diagnosis),
        findings::experiment(diagnosis),
        findings::open(diagnosis),
        findings::model(diagnosis),
    ];
    page(&format!("{title}: diagnosis"), &sections.concat())
}

/// A self-contained page around what it holds.
pub fn page(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        escape(title),
    )
}

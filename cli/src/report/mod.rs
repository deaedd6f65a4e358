//! Pages about results: self-contained HTML, no scripts, nothing fetched, light and dark, any width. The drawing is here for every verb; so are the pages, but for
//! the diagnosis' own.

pub mod align;
mod axis;
pub mod calibrate;
pub mod certificate;
pub mod characterise;
pub mod diagnosis;
mod dial;
mod download;
mod figure;
pub mod fix;
mod html;
mod plot;
pub mod track;

use std::path::{Path, PathBuf};

use clap::Args;
use time::OffsetDateTime;

use crate::failure::Failure;
use crate::file_error::FileError;

pub use self::axis::{Axis, quantile_of_sizes};
pub use self::download::{cell, csv, file};
pub use self::figure::{Canvas, Legend, figure};
pub use self::html::{code_list, escape, number, p_value, probability, short, table, tile, with_sigma};
pub use self::plot::{Plot, Side};

const STYLE: &str = include_str!("style.css");

/// The option of every command that draws its result.
#[derive(Args, Clone, Debug, Default)]
pub struct ReportOption {
    /// Write a page with pictures of the result: one HTML file that fetches nothing
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
}

impl ReportOption {
    /// Where the page goes.
    pub fn path(&self) -> Option<&Path> {
        self.report.as_deref()
    }

    /// Writes the page, if it was asked for.
    pub fn write(&self, page: impl FnOnce() -> String) -> Result<(), Failure> {
        write(self.path(), page)
    }
}

/// Writes a page to a file, if there is one.
pub fn write(path: Option<&Path>, page: impl FnOnce() -> String) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    crate::output::write(path, page()).map_err(|error| FileError::whole(path, error).into())
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

/// The head of a page: what it is about, what made it and when, and the result in a sentence.
fn head(title: &str, about: &[String], result: &str) -> String {
    let made = [format!("north {}", env!("CARGO_PKG_VERSION")), today()];
    let about: Vec<String> = made.iter().chain(about).map(|part| escape(part)).collect();
    format!(
        "<h1>{}</h1>\n<p class=\"soft\">{}</p>\n<p class=\"verdict\">{}</p>\n",
        escape(title),
        about.join(" · "),
        escape(result)
    )
}

fn today() -> String {
    OffsetDateTime::now_utc().date().to_string()
}

//! The page about a diagnosis.

mod abscissa;
mod dwells;
mod errors;
mod findings;
mod residuals;
mod summary;

use super::page;
use crate::diagnose::Diagnosis;

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

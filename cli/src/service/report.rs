//! The history of an instrument as a page: every signal by the fix, what is normal, and what changed.

use super::watch::{ALARM, BASELINE};
use super::{Cause, Change, History, Signal};
use crate::count::counted;
use crate::report::{Axis, Legend, Plot, Side, escape, figure, page, table};

/// Heights of the drawings, pixels.
const HEIGHT: f64 = 200.0;
/// Where the statistic's axis begins: less says nothing.
const LEAST_STATISTIC: f64 = 0.01;

/// The page.
pub fn html(history: &History<'_>) -> String {
    let fixes = history.log.fixes.len();
    let verdict = match history.verdict.alarm {
        Some(at) => format!("The error model no longer holds: seen with fix {}.", history.log.fixes[at].fix),
        None => format!("The error model holds in the {} watched.", counted(history.verdict.watched, "fix")),
    };
    let mut body = format!(
        "<h1>An instrument in service</h1>\n<p class=\"soft\">{fixes} fixes; the first {BASELINE} say what is normal.</p>\n<p class=\"verdict\">{verdict}</p>\n"
    );
    for said in history.not_watched() {
        body += &format!("<p class=\"soft\">{}</p>\n", escape(&said));
    }
    if !history.verdict.changes.is_empty() {
        body += "<h2>What changed</h2>\n";
        body += &changes(history);
    }
    body += "<h2>History</h2>\n";
    body += &history.signals.iter().map(|signal| drawing(history, signal)).collect::<String>();
    body += &statistic(history);
    page("An instrument in service", &body)
}

fn changes(history: &History<'_>) -> String {
    let head =
        [("signal", false), ("since fix", true), ("what", false), ("coefficient", false), ("runs that show it", false)];
    let row = |(number, change): (usize, &Change)| {
        let moved = history.moved[number].as_ref().map_or("–".into(), |moved| {
            format!("{}: {:.5} {:+.5} ± {:.5} {}", moved.coefficient, moved.before, moved.by, moved.sigma, moved.unit)
        });
        let cause = match change.cause {
            Cause::Step => "step",
            Cause::Ramp => "ramp",
            Cause::Temperature => "temperature, for each kelvin",
        };
        vec![
            change.signal.name().into(),
            history.log.fixes[change.from].fix.to_string(),
            format!("{cause}: {:+.4} ± {:.4} {}", change.size, change.sigma, change.unit),
            escape(&moved),
            escape(&history.needed[number].sentence()),
        ]
    };
    table(&head, &history.verdict.changes.iter().enumerate().map(row).collect::<Vec<_>>())
}

/// Numbers of the fixes, of a part of the log.
fn numbers(history: &History<'_>, from: usize) -> impl Iterator<Item = f64> {
    history.log.fixes.iter().skip(from).map(|fix| fix.fix as f64)
}

fn drawing(history: &History<'_>, signal: &Signal) -> String {
    let normal = &signal.values[..BASELINE.min(signal.values.len())];
    let mean = normal.iter().sum::<f64>() / normal.len() as f64;
    let deviation = (normal.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / normal.len() as f64).sqrt();
    let change = history.verdict.changes.iter().find(|change| change.signal == signal.kind);
    let name = signal.kind.name();
    let told = match change {
        Some(change) => {
            format!("The upright line is fix {}, with which it changed.", history.log.fixes[change.from].fix)
        }
        None => "It has not changed.".into(),
    };
    let caption = format!(
        "{name} of every fix; hollow dots: the {BASELINE} that say what is normal, with their mean and two standard deviations (dashed). {told}"
    );
    figure(Legend::None, &format!("{name} by fix"), &caption, |canvas| {
        let x = Axis::linear("fix", numbers(history, 0));
        let y = Axis::linear(format!("{name}, {}", signal.kind.unit()), signal.values.iter().copied());
        let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
        for level in [mean - 2.0 * deviation, mean, mean + 2.0 * deviation] {
            plot.level("reference", level);
        }
        if let Some(change) = change {
            plot.upright("line after", history.log.fixes[change.from].fix as f64);
        }
        plot.dots(Side::Before, numbers(history, 0).zip(normal.iter().copied()));
        plot.dots(Side::After, numbers(history, BASELINE).zip(signal.values.iter().skip(BASELINE).copied()));
        vec![plot]
    })
}

fn statistic(history: &History<'_>) -> String {
    let caption = format!(
        "The statistic of the test: {ALARM} (dashed) is an alarm. False ones come after {ALARM} fixes on average, or later."
    );
    figure(Legend::None, "statistic by fix", &caption, |canvas| {
        let values = || history.verdict.statistic.iter().map(|value| value.max(LEAST_STATISTIC));
        let x = Axis::linear("fix", numbers(history, 0));
        let y = Axis::logarithmic("statistic", values().chain([ALARM]));
        let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
        plot.level("reference", ALARM);
        plot.line("line after", numbers(history, BASELINE).zip(values()));
        vec![plot]
    })
}

//! Progress of long work: a bar on stderr, and only on a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `count` things called `unit`. It draws nothing unless stderr is a terminal.
pub fn bar(count: u64, unit: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix} [{bar:40}] {pos}/{len} {msg}, {eta} to go")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count).with_style(style).with_message(unit.to_owned())
}

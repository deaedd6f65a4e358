//! Progress of long work: a bar on stderr, and only on a terminal.

use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::failure::Failure;
use crate::interrupt;

/// How often an interrupt is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// A bar over `count` things called `unit`. It draws nothing unless stderr is a terminal.
pub fn bar(count: u64, unit: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix} [{bar:40}] {pos}/{len} {msg}, {eta} to go")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count).with_style(style).with_message(unit.to_owned())
}

/// Does long work whose length nobody knows, with the time that it takes on stderr where that is a terminal. An interrupt ends
/// it at once: the work is left behind, at the latest to die with the process.
pub fn work<T: Send + 'static>(what: String, work: impl FnOnce() -> T + Send + 'static) -> Result<T, Failure> {
    let style =
        ProgressStyle::with_template("{spinner} {msg}, {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message(what);
    let done = interruptible(work, || bar.tick());
    bar.finish_and_clear();
    done
}

/// The same; meanwhile something is done again and again.
pub fn interruptible<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
    mut meanwhile: impl FnMut(),
) -> Result<T, Failure> {
    let stop = interrupt::flag();
    let worker = thread::spawn(work);
    while !worker.is_finished() {
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Interrupted);
        }
        meanwhile();
        thread::sleep(LOOK);
    }
    worker.join().map_err(|panic| std::panic::resume_unwind(panic))
}

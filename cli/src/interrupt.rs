//! Ctrl-C, termination and hang-up: noted, so that whatever runs can end in good order, and at once.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

static STOP: AtomicBool = AtomicBool::new(false);

/// Time to end in good order; then the process ends as it is. (What it started ends with it: QEMU's image sees its input close.)
const GRACE: Duration = Duration::from_millis(500);
/// The exit code of what was interrupted, as shells have it.
const INTERRUPTED: i32 = 130;

/// Notes interrupts from now on instead of dying of them at once. A second one does not wait.
pub fn watch() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED);
        }
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            eprintln!("north: interrupted");
            process::exit(INTERRUPTED);
        });
    })
}

/// Raises the flag, or lowers it: for a program that calls the commands and has interrupts of its own.
pub fn request(stop: bool) {
    STOP.store(stop, Ordering::Relaxed);
}

/// The flag that an interrupt raises.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Whether there was an interrupt.
pub fn requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

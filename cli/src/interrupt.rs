//! Ctrl-C, termination and hang-up: noted, so that whatever runs can end in good order.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// Notes interrupts from now on instead of dying of them.
pub fn watch() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed))
}

/// The flag that an interrupt raises.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Whether there was an interrupt.
pub fn requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

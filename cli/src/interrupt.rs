//! Ctrl-C, termination and hang-up: noted, so that whatever runs can end in good order, and at once.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The flag of a process that runs one command.
static STOP: AtomicBool = AtomicBool::new(false);
/// The flag of the command that runs now.
static CURRENT: Mutex<&'static AtomicBool> = Mutex::new(&STOP);

/// Time to end in good order; then the process ends as it is. (What it started ends with it: QEMU's image sees its input close.)
const GRACE: Duration = Duration::from_millis(500);
/// The exit code of what was interrupted, as shells have it.
const INTERRUPTED: i32 = 130;

/// Notes interrupts from now on instead of dying of them at once. A second one does not wait.
pub fn watch() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if flag().swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED);
        }
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            eprintln!("north: interrupted");
            process::exit(INTERRUPTED);
        });
    })
}

/// From now on this flag is the one that an interrupt raises: for a program that calls one command after the other, each with a flag of its own.
pub fn install(stop: &'static AtomicBool) {
    *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = stop;
}

/// The flag that an interrupt of the command that runs now raises. Work that may outlive its command takes it once, when it begins: a later call gives
/// the flag of another command.
pub fn flag() -> &'static AtomicBool {
    *CURRENT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether there was an interrupt of the command that runs now.
pub fn requested() -> bool {
    flag().load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an interrupted command left behind keeps its flag. (None is raised: other tests of this process may have taken it.)
    #[test]
    fn the_next_command_has_a_flag_of_its_own() {
        static NEXT: AtomicBool = AtomicBool::new(false);
        let before = flag();
        install(&NEXT);
        let after = flag();
        install(before);
        assert!(std::ptr::eq(after, &NEXT) && !std::ptr::eq(before, &NEXT));
    }
}

//! defmt's log, frame by frame over the exchange.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::RestoreState;
use heapless::Vec;

/// Longest frame; a longer one is left out.
const MAX_FRAME: usize = 256;

#[defmt::global_logger]
struct Logger;

struct Frame {
    taken: AtomicBool,
    inner: UnsafeCell<Inner>,
}

struct Inner {
    restore: RestoreState,
    encoder: defmt::Encoder,
    bytes: Vec<u8, MAX_FRAME>,
    complete: bool,
}

// SAFETY: `inner` is touched only between `acquire` and `release`, which is a critical section on the only core, and
// `taken` refuses a second one inside it.
unsafe impl Sync for Frame {}

static FRAME: Frame = Frame {
    taken: AtomicBool::new(false),
    inner: UnsafeCell::new(Inner {
        restore: RestoreState::invalid(),
        encoder: defmt::Encoder::new(),
        bytes: Vec::new(),
        complete: true,
    }),
};

/// The frame that is being written.
///
/// # Safety
///
/// Only between `acquire` and `release`, and one at a time.
unsafe fn frame() -> &'static mut Inner {
    // SAFETY: as above.
    unsafe { &mut *FRAME.inner.get() }
}

fn keep<'a>(bytes: &'a mut Vec<u8, MAX_FRAME>, complete: &'a mut bool) -> impl FnMut(&[u8]) + 'a {
    |part| *complete &= bytes.extend_from_slice(part).is_ok()
}

// SAFETY: `acquire` begins a critical section that `release` ends, so that frames do not mix.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: `release` ends it.
        let restore = unsafe { critical_section::acquire() };
        assert!(!FRAME.taken.swap(true, Ordering::Relaxed), "a log line inside a log line");
        // SAFETY: the critical section has begun.
        let Inner { restore: kept, encoder, bytes, complete } = unsafe { frame() };
        *kept = restore;
        bytes.clear();
        *complete = true;
        encoder.start_frame(keep(bytes, complete));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: `acquire` came before.
        let Inner { restore, encoder, bytes, complete } = unsafe { frame() };
        encoder.end_frame(keep(bytes, complete));
        if *complete {
            super::with(|state| state.exchange.tell(b'L', &[bytes]));
        }
        FRAME.taken.store(false, Ordering::Relaxed);
        // SAFETY: the state is that of the matching `acquire`.
        unsafe { critical_section::release(*restore) };
    }

    unsafe fn write(part: &[u8]) {
        // SAFETY: defmt calls this between `acquire` and `release`.
        let Inner { encoder, bytes, complete, .. } = unsafe { frame() };
        encoder.write(part, keep(bytes, complete));
    }
}

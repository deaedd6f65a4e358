//! The three functions that the page's script calls. Text goes both ways through one buffer.

use std::cell::RefCell;

use crate::{Act, Answer, Bench};

thread_local! {
    static BENCH: RefCell<(Bench, Vec<u8>)> = RefCell::default();
}

/// Where the script puts a request of this many bytes, UTF-8.
// No other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn buffer(length: usize) -> *mut u8 {
    BENCH.with_borrow_mut(|(_, buffer)| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// Does what stands in the buffer, an [`Act`] as JSON. The answer, an [`Answer`] as JSON, is there then, so many bytes long.
// No other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn act() -> usize {
    BENCH.with_borrow_mut(|(bench, buffer)| {
        let answer = match serde_json::from_slice::<Act>(buffer) {
            Ok(act) => bench.act(act),
            Err(error) => Answer { error: Some(error.to_string()), ..Answer::default() },
        };
        *buffer = serde_json::to_vec(&answer).unwrap_or_default();
        buffer.len()
    })
}

/// Where the answer is.
// No other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    BENCH.with_borrow(|(_, buffer)| buffer.as_ptr())
}

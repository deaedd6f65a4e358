//! The test of the memory that nothing uses.

use cortex_m_rt::STACK_PAINT_VALUE;
use north_finder::event::restart::WORDS;

unsafe extern "C" {
    /// Where the variables end.
    static __sheap: u32;
    /// Where the memory for variables ends.
    static _crash: [u32; WORDS];
    static _stack_end: u32;
}

const WORD: usize = 4;
/// Below the stack pointer of the caller: room for the test itself.
const IN_USE: usize = 512;

/// Words that do not hold what is written to them, of all that is unused: above the variables, and of the stack what lies below the
/// part in use. It is left as painted as it was. For the start alone, with interrupts off.
#[inline(never)]
pub fn test() -> u32 {
    let variables_end = &raw const __sheap as usize;
    let in_use = cortex_m::register::msp::read() as usize - IN_USE;
    wrong_words(variables_end, &raw const _crash as usize) + wrong_words(&raw const _stack_end as usize, in_use)
}

/// Every bit is written both ways, and every word differs from all others: an address line that is stuck shows.
fn wrong_words(from: usize, to: usize) -> u32 {
    let patterns: [fn(usize) -> u32; 3] = [|at| at as u32, |at| !(at as u32), |_| STACK_PAINT_VALUE];
    let mut before: Option<fn(usize) -> u32> = None;
    let mut wrong = 0;
    for pattern in patterns {
        for at in (from..to).step_by(WORD) {
            let word = at as *mut u32;
            // SAFETY: memory of the chip that the linker gave to nothing, or stack that is not in use; nothing else runs.
            let holds = unsafe { word.read_volatile() };
            wrong += u32::from(before.is_some_and(|before| holds != before(at)));
            // SAFETY: as above.
            unsafe { word.write_volatile(pattern(at)) };
        }
        before = Some(pattern);
    }
    wrong
}

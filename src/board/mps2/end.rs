//! How the firmware ends in QEMU: on demand, or because the exchange with the world is broken. A test never hangs.

use cortex_m_semihosting::debug;

use super::State;
use super::exchange::{self, Exchange};
use crate::board::crash::StackSweep;

/// The power goes off: the last words to the host.
pub fn power_off(state: &mut State) -> ! {
    let mut sweep = StackSweep::default();
    sweep.go_on(usize::MAX);
    state.exchange.tell(b'Z', &[&sweep.finish().to_le_bytes()]);
    exchange::exit(debug::EXIT_SUCCESS)
}

/// The host's answer is none: tells it so, and ends QEMU.
pub fn broken(why: &str) -> ! {
    cortex_m::interrupt::disable();
    // A new one: the board's own is in use.
    let mut exchange = Exchange::closed();
    exchange.open();
    exchange.tell(b'P', &[why.as_bytes()]);
    exchange::exit(debug::EXIT_FAILURE)
}

//! How the firmware ends in QEMU: on demand, by a panic, by a fault. A test never hangs.

use core::fmt::Write;

use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug;
use heapless::String;

use super::State;
use super::exchange::{self, Exchange};

/// The power goes off: the last words to the host.
pub fn power_off(state: &mut State) -> ! {
    state.exchange.tell(b'Z', &[&most_stack_bytes().to_le_bytes()]);
    exchange::exit(debug::EXIT_SUCCESS)
}

/// How much of the stack was ever used, by the paint that is gone from it.
fn most_stack_bytes() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (top, mut at) = (&raw const _stack_start, &raw const _stack_end);
    // SAFETY: from `at` to `top` is the stack, which starts at the top and was painted before main.
    unsafe {
        while at < top && at.read_volatile() == cortex_m_rt::STACK_PAINT_VALUE {
            at = at.add(1);
        }
        top.byte_offset_from(at) as u32
    }
}

/// Tells the host why, and ends QEMU.
fn die(why: core::fmt::Arguments) -> ! {
    cortex_m::interrupt::disable();
    let mut text = String::<512>::new();
    // What does not fit is left out.
    let _ = text.write_fmt(why);
    // A new one: the board's own may be in use where the panic came from.
    let mut exchange = Exchange::closed();
    exchange.open();
    exchange.tell(b'P', &[text.as_bytes()]);
    exchange::exit(debug::EXIT_FAILURE)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    die(format_args!("{info}"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(format_args!("hard fault at {:#010x}", frame.pc()))
}

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    die(format_args!("interrupt {number} has no task"))
}

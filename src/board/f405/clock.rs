//! The clock: 168 MHz from the crystal; from the internal oscillator, which is good to 1 %, where the crystal does not start.

use stm32f4xx_hal::pac;
use stm32f4xx_hal::rcc::{Config, Rcc, RccExt as _};
use stm32f4xx_hal::time::Hertz;

use super::model::CLOCK_COMES_IN;

const CRYSTAL: Hertz = Hertz::MHz(8);
pub const SYSTEM: Hertz = Hertz::MHz(168);
/// A crystal takes some 2 ms, the phase-locked loop 0.3 ms: this many looks take ten times as long.
const LOOKS: u32 = 100_000;

/// Starts the fastest clock that there is; gives whether it is the crystal's.
///
/// The loop too is waited for only so long: without it the processor runs at the internal oscillator's 16 MHz.
pub fn start(registers: pac::RCC) -> (Rcc, bool) {
    if CLOCK_COMES_IN {
        registers.cr().modify(|_, w| w.hsebyp().bypassed());
    }
    registers.cr().modify(|_, w| w.hseon().on());
    let crystal = comes(|| registers.cr().read().hserdy().is_ready());
    // As after a reset, from the internal oscillator: it is only to be seen whether the loop locks.
    registers.cr().modify(|_, w| w.pllon().on());
    let loop_locks = comes(|| registers.cr().read().pllrdy().is_ready());
    registers.cr().modify(|_, w| w.pllon().off());
    let source = match (crystal, loop_locks) {
        (true, true) => {
            let source = Config::hse(CRYSTAL).sysclk(SYSTEM);
            if CLOCK_COMES_IN { source.bypass_hse_oscillator() } else { source }
        }
        (false, true) => {
            registers.cr().modify(|_, w| w.hseon().off());
            Config::hsi().sysclk(SYSTEM)
        }
        (_, false) => Config::hsi(),
    };
    let rcc = registers.freeze(source);
    if crystal && loop_locks {
        // From now on a crystal that stops raises the interrupt that cannot be masked.
        rcc.cr().modify(|_, w| w.csson().on());
    }
    (rcc, crystal && loop_locks)
}

/// Whether it comes in time.
fn comes(ready: impl Fn() -> bool) -> bool {
    (0..LOOKS).any(|_| ready())
}

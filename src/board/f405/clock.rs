//! The clock: 168 MHz from the crystal, whichever of the usual ones it is; from the internal oscillator, which is good to 1 %, where the
//! crystal does not start or is none of them.
//!
//! The crystal is measured before anything runs from it: multiplied by the wrong number, it is beyond what the chip bears. No wait is
//! without a bound.
//!
//! Source: RM0090, revision 19, 7.3.2 (phase-locked loop), 7.2.11 and 19.5.11 (measuring the crystal by timer 11).

use stm32f4xx_hal::pac::{self, rcc};
use stm32f4xx_hal::rcc::{Config, Rcc, RccExt as _};
use stm32f4xx_hal::time::Hertz;

use super::model::CLOCK_COMES_IN;

pub const SYSTEM: Hertz = Hertz::MHz(168);
/// Crystals that boards have, MHz. The loop's input is 1 MHz with each of them, its oscillator's frequency 336.
const CRYSTALS_MHZ: [u32; 4] = [8, 12, 16, 25];
const LOOP_MHZ: u16 = 336;
/// The internal oscillator is off by 8 % at most over all temperatures (STM32F405 data sheet, ACC_HSI): within a tenth of its frequency a
/// crystal is known, and no two of them are so near to each other.
const TOLERANCE: u32 = 10;
/// A crystal takes some 2 ms, the phase-locked loop 0.3 ms: this many looks take ten times as long.
const LOOKS: u32 = 100_000;
/// The crystal's clock is divided by this (RTCPRE) for timer 11, which sees every eighth of its edges.
const DIVISOR: u8 = 31;
const EDGES: u32 = 8;

/// Starts the fastest clock that there is; gives whether it is the crystal's.
///
/// First it is that of the internal oscillator, then, if it is a known one, the crystal's. Without the loop the processor runs at the
/// internal oscillator's 16 MHz.
pub fn start(registers: pac::RCC, timer: &pac::TIM11) -> (Rcc, bool) {
    if CLOCK_COMES_IN {
        registers.cr().modify(|_, w| w.hsebyp().bypassed());
    }
    registers.cr().modify(|_, w| w.hseon().on());
    let starts = comes(|| registers.cr().read().hserdy().is_ready());
    // As after a reset, from the internal oscillator: it is only to be seen whether the loop locks.
    registers.cr().modify(|_, w| w.pllon().on());
    let loop_locks = comes(|| registers.cr().read().pllrdy().is_ready());
    registers.cr().modify(|_, w| w.pllon().off());
    let rcc = registers.freeze(if loop_locks { Config::hsi().sysclk(SYSTEM) } else { Config::hsi() });
    let crystal_mhz = if starts && loop_locks { known(measured_khz(&rcc, timer)) } else { None };
    let crystal = crystal_mhz.is_some_and(|mhz| run_from(&rcc, mhz));
    if crystal {
        // From now on a crystal that stops raises the interrupt that cannot be masked.
        rcc.cr().modify(|_, w| w.csson().on());
    } else {
        rcc.cr().modify(|_, w| w.hseon().off());
    }
    (rcc, crystal)
}

/// The crystal's frequency by the timer's clock, which is 168 MHz, kHz; 0 where there are no edges.
fn measured_khz(rcc: &rcc::RegisterBlock, timer: &pac::TIM11) -> u32 {
    const FROM_CRYSTAL: u32 = 0b10;
    const INPUT_EVERY_EIGHTH: u32 = 0b1101;
    rcc.cfgr().modify(|_, w| w.rtcpre().set(DIVISOR));
    rcc.apb2enr().modify(|_, w| w.tim11en().enabled());
    // SAFETY: values of the reference manual, here and below.
    timer.or().write(|w| unsafe { w.bits(FROM_CRYSTAL) });
    timer.ccmr1_input().write(|w| unsafe { w.bits(INPUT_EVERY_EIGHTH) });
    timer.arr().write(|w| unsafe { w.bits(u16::MAX.into()) });
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
    // The first one may be of before; reading it makes room for the next.
    let captured = || comes(|| timer.sr().read().cc1if().bit_is_set()).then(|| timer.ccr1().read().bits() as u16);
    let [_, first, second] = [captured(), captured(), captured()];
    timer.cr1().write(|w| w.cen().clear_bit());
    rcc.apb2enr().modify(|_, w| w.tim11en().disabled());
    let cycles = first.zip(second).map_or(0, |(first, second)| second.wrapping_sub(first));
    (u32::from(DIVISOR) * EDGES * (SYSTEM.raw() / 1000)).checked_div(cycles.into()).unwrap_or(0)
}

/// The crystal that has this frequency, MHz.
fn known(khz: u32) -> Option<u32> {
    CRYSTALS_MHZ.into_iter().find(|mhz| khz.abs_diff(mhz * 1000) <= mhz * 1000 / TOLERANCE)
}

/// Gives the loop the crystal in the place of the internal oscillator, which the processor runs from meanwhile; gives whether it locks.
/// The dividers of the buses and the flash's wait states stay.
fn run_from(rcc: &rcc::RegisterBlock, crystal_mhz: u32) -> bool {
    let internal = rcc.pllcfgr().read().bits();
    // SAFETY: a divider of 8 to 25, a factor of 336, by 2 for 168 MHz and by 7 for 48; below, what was there before.
    let locks = relock(rcc, || {
        rcc.pllcfgr().write(|w| unsafe {
            w.pllsrc().hse().pllm().bits(crystal_mhz as u8).plln().bits(LOOP_MHZ).pllp().div2().pllq().bits(7)
        });
    });
    locks || {
        relock(rcc, || {
            rcc.pllcfgr().write(|w| unsafe { w.bits(internal) });
        });
        false
    }
}

/// Stops the loop, sets it up, and runs from it; gives whether it locks.
fn relock(rcc: &rcc::RegisterBlock, set_up: impl FnOnce()) -> bool {
    rcc.cfgr().modify(|_, w| w.sw().hsi());
    comes(|| rcc.cfgr().read().sws().is_hsi());
    rcc.cr().modify(|_, w| w.pllon().off());
    comes(|| rcc.cr().read().pllrdy().is_not_ready());
    set_up();
    rcc.cr().modify(|_, w| w.pllon().on());
    let locks = comes(|| rcc.cr().read().pllrdy().is_ready());
    if locks {
        rcc.cfgr().modify(|_, w| w.sw().pll());
        comes(|| rcc.cfgr().read().sws().is_pll());
    }
    locks
}

/// Whether it comes in time.
fn comes(ready: impl Fn() -> bool) -> bool {
    (0..LOOKS).any(|_| ready())
}

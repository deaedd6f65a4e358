//! The analogue inputs, on converter 1: PC0 to PC3, the supply behind its divider at PC4, the chip's own thermometer and reference.
//!
//! Source: RM0090, revision 19, 13 (converters), 13.10 (thermometer); DS8626, tables 70, 71 and 74 (what the maker converted).

use north_finder::drivers::analogue::{self, Converter as _, Input};
use north_finder::instrument::analogue::Calibration;
use stm32f4xx_hal::gpio::{Analog, PC0, PC1, PC2, PC3, PC4};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};

/// Sampling and conversion take 492 clocks of 21 MHz, 23 µs: the thermometer wants 10, and 10 kΩ with 100 nF at a pin give their charge.
const LONGEST_SAMPLING: u32 = 0o777_777_777;
/// A conversion takes 23 µs: this many looks take ten times as long.
const LOOKS: u32 = 10_000;
const REFERENCE: u8 = 17;
/// The thermometer's channel differs: 16 in the STM32F405, 18 in later ones, by the chip's own identity.
const THERMOMETER: u8 = 18;
const THERMOMETER_F405: u8 = 16;
const F405: u16 = 0x413;
const REFERENCE_AT_MAKER: *const u16 = 0x1FFF_7A2A as *const u16;
const THERMOMETER_AT_MAKER: [*const u16; 2] = [0x1FFF_7A2C as *const u16, 0x1FFF_7A2E as *const u16];

/// The inputs and the divided supply.
type Pins = (PC0<Analog>, PC1<Analog>, PC2<Analog>, PC3<Analog>, PC4<Analog>);

/// The converter.
pub struct Converter {
    registers: pac::ADC1,
    thermometer: u8,
}

impl Converter {
    /// The pins are only to be analogue.
    pub fn new(registers: pac::ADC1, common: &pac::ADC_COMMON, _pins: Pins, rcc: &mut Rcc) -> Self {
        pac::ADC1::enable(rcc);
        pac::ADC1::reset(rcc);
        common.ccr().write(|w| w.adcpre().div4().tsvrefe().set_bit());
        // SAFETY: three bits for each of nine channels, all ones.
        registers.smpr1().write(|w| unsafe { w.bits(LONGEST_SAMPLING) });
        registers.cr2().write(|w| w.adon().set_bit());
        // SAFETY: reading has no effect.
        let identity = unsafe { (*pac::DBGMCU::ptr()).idcode().read().dev_id().bits() };
        Self { registers, thermometer: if identity == F405 { THERMOMETER_F405 } else { THERMOMETER } }
    }

    /// The noise of 128 conversions of the thermometer, whose last bits are nobody's to know: what is like no other start. Not every chip has a generator of
    /// random numbers; this is enough to make no challenge twice.
    pub fn entropy(&mut self) -> [u32; 4] {
        core::array::from_fn(|_| {
            (0..u32::BITS).fold(0, |word: u32, _| {
                self.start(Input::Chip);
                let code = (0..LOOKS).find_map(|_| self.result()).unwrap_or_default();
                word.rotate_left(1) ^ u32::from(code)
            })
        })
    }
}

impl analogue::Converter for Converter {
    fn start(&mut self, input: Input) {
        let channel = match input {
            Input::First => 10,
            Input::Second => 11,
            Input::Third => 12,
            Input::Fourth => 13,
            Input::Supply => 14,
            Input::Chip => self.thermometer,
            Input::Reference => REFERENCE,
        };
        // SAFETY: a channel that there is, the only one of the sequence.
        self.registers.sqr3().write(|w| unsafe { w.bits(channel.into()) });
        self.registers.cr2().modify(|_, w| w.swstart().set_bit());
    }

    fn result(&mut self) -> Option<u16> {
        let done = self.registers.sr().read().eoc().bit_is_set();
        done.then(|| self.registers.dr().read().data().bits())
    }
}

/// What the maker of the chip converted.
pub fn analogue_calibration() -> Calibration {
    let [at_30_c, at_110_c] = THERMOMETER_AT_MAKER;
    // SAFETY: memory that the chip's maker wrote.
    unsafe {
        Calibration {
            reference: REFERENCE_AT_MAKER.read_volatile(),
            at_30_c: at_30_c.read_volatile(),
            at_110_c: at_110_c.read_volatile(),
        }
    }
}

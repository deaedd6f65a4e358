//! The motor's driver: Texas Instruments DRV8825 (revision F, timing requirements), the slowest of the usual ones: a step at the rising edge,
//! 1.9 µs high and low at least; direction and enable 0.65 µs before, direction 0.65 µs after it.

use rigless::device::Level;

use super::{Chip, Ledger, Pin};
use crate::microcontroller::MotorPins;

const STEP_NS: u64 = 1_900;
const AROUND_STEP_NS: u64 = 650;
/// Of two steps: the motor's slots are 312.5 µs, and a slot is late by no more than the highest interrupts take.
const APART_NS: u64 = 300_000;
const PINS: [Pin; 3] = [('C', 6), ('C', 7), ('C', 8)];

/// What it gets, and since when, ns.
#[derive(Debug, Default)]
pub struct Motor {
    levels: MotorPins,
    step_ns: u64,
    direction_ns: u64,
    enable_ns: u64,
    rose_ns: Option<u64>,
}

impl Motor {
    pub fn sees(&mut self, levels: MotorPins, at: u64, ledger: &Ledger) {
        if levels.not_enable != self.levels.not_enable {
            self.enable_ns = at;
        }
        if levels.direction != self.levels.direction {
            let since_ns = self.rose_ns.map_or(u64::MAX, |rose| at - rose);
            ledger.least("motor: direction after a step", since_ns, AROUND_STEP_NS);
            self.direction_ns = at;
        }
        match (self.levels.step, levels.step) {
            (Level::Low, Level::High) => {
                ledger.must(levels.not_enable == Level::Low, || "motor: a step without current".into());
                ledger.least("motor: enabled before a step", at - self.enable_ns, AROUND_STEP_NS);
                ledger.least("motor: direction before a step", at - self.direction_ns, AROUND_STEP_NS);
                ledger.least("motor: step low", at - self.step_ns, STEP_NS);
                let apart_ns = self.rose_ns.map_or(u64::MAX, |rose| at - rose);
                ledger.least("motor: from step to step", apart_ns, APART_NS);
                (self.rose_ns, self.step_ns) = (Some(at), at);
            }
            (Level::High, Level::Low) => {
                ledger.least("motor: step high", at - self.step_ns, STEP_NS);
                self.step_ns = at;
            }
            _ => {}
        }
        self.levels = levels;
    }
}

/// The pins drive both ways.
pub fn look(chip: &mut Chip<'_>, ledger: &Ledger) {
    let open = chip.register(super::port_base('C') + 0x04);
    for pin in PINS {
        let drives = chip.pin(pin).0 == 1 && open >> pin.1 & 1 == 0;
        ledger.must(drives, || format!("motor: pin {pin:?} is no push-pull output"));
    }
}

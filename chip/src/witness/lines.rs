//! The serial lines, as the parts at their ends are set: 8 data bits, no parity, one stop bit, and baud rates within 2 % (half of a bit in
//! the ten of a byte is 5 %, for both ends together).

use super::{Chip, Ledger, Pin};

const BRR: u64 = 0x08;
const CR1: u64 = 0x0C;
const CR2: u64 = 0x10;
const CR3: u64 = 0x14;
/// RM0090, 30.6.4: oversampling by 8, enabled, nine bits, parity, transmitter, receiver.
const OVER_8: u64 = 1 << 15;
const ENABLED: u64 = 1 << 13;
const NINE_BITS: u64 = 1 << 12;
const PARITY: u64 = 1 << 10;
const TRANSMITTER: u64 = 1 << 3;
const RECEIVER: u64 = 1 << 2;
const STOP_BITS: u64 = 0b11 << 12;
/// One wire for both ways, smart card, infra-red.
const OTHER_KINDS: u64 = 1 << 1 | 1 << 3 | 1 << 5;
const TOLERANCE: u64 = 50;

struct Line {
    name: &'static str,
    base: u64,
    clock: usize,
    baud: u64,
    directions: u64,
    pins: &'static [Pin],
}

const LINES: [Line; 2] = [
    Line {
        name: "gyro's line",
        base: 0x4001_1000,
        clock: 1,
        baud: 921_600,
        directions: RECEIVER | TRANSMITTER,
        pins: &[('A', 9), ('A', 10)],
    },
    Line {
        name: "host's line",
        base: 0x4000_4400,
        clock: 0,
        baud: 115_200,
        directions: RECEIVER | TRANSMITTER,
        pins: &[('A', 2), ('A', 3)],
    },
];
const FUNCTION: u64 = 7;

/// Called while the lines are in use.
pub fn look(chip: &mut Chip<'_>, ledger: &Ledger) {
    for line in &LINES {
        let [rate, first, second, third] = [BRR, CR1, CR2, CR3].map(|register| chip.register(line.base + register));
        let name = line.name;
        ledger.must(first & ENABLED != 0 && first & line.directions == line.directions, || format!("{name} is off"));
        ledger.must(first & (NINE_BITS | PARITY) == 0, || format!("{name}: nine bits, or parity"));
        ledger.must(second & STOP_BITS == 0, || format!("{name}: not one stop bit"));
        ledger.must(third & OTHER_KINDS == 0, || format!("{name}: CR3 is {third:04x}"));
        // The fraction has three bits where it samples eight times, and is aligned as if it had four.
        let sixteenths = if first & OVER_8 == 0 { rate } else { (rate & 0xFFF0 | (rate & 7) << 1) / 2 };
        let baud = chip.bus_hz()[line.clock] / sixteenths.max(1);
        let right = baud.abs_diff(line.baud) <= line.baud / TOLERANCE;
        ledger.must(right, || format!("{name}: {baud} baud, not {}", line.baud));
        for &pin in line.pins {
            ledger.must(chip.pin(pin) == (2, FUNCTION), || format!("{name}: pin {pin:?} is not the line's"));
        }
    }
}

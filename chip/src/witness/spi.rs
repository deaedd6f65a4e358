//! The SPI buses, each with one part behind its select line.

use super::{Chip, Ledger, Pin};

const CR1: u64 = 0x00;
const SR: u64 = 0x08;
const DR: u64 = 0x0C;
const BUSY: u64 = 1 << 7;
/// Of CR1: phase and polarity; master, enabled; what must be off: least significant bit first, receiving only, frames of 16 bits, check sums,
/// one line for both ways (RM0090, 28.5.1).
const MODE: u64 = 0b11;
const ON: u64 = 1 << 2 | 1 << 6;
const OFF: u64 = 1 << 7 | 1 << 10 | 1 << 11 | 1 << 13 | 1 << 15;
/// The output data register of a port, and its set and reset register.
const ODR: u64 = 0x14;
const BITS: u64 = 8;

/// A bus and what the part on it allows.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    part: &'static str,
    base: u64,
    /// APB1 or APB2.
    clock: usize,
    select: Pin,
    /// Clock, data in, data out.
    wires: [Pin; 3],
    function: u64,
    /// Bit 0 phase, bit 1 polarity.
    mode: u64,
    /// Of the clock, Hz: in frames, and where the first byte begins a burst.
    hz: [u64; 2],
    burst_hz: Option<(u8, u64)>,
    /// Select line low to the first edge, last edge to high, and high in between, ns.
    setup_ns: u64,
    hold_ns: u64,
    apart_ns: u64,
    /// Bytes between two selections, where they are always as many.
    bytes: Option<u64>,
    /// From the last edge of a frame to the first of the next, ns.
    stall_ns: u64,
}

pub const BUSES: [Rules; 3] = [
    // Analog Devices, ADXL354/ADXL355, revision B, "SPI protocol" and its timing table: mode 0, at most 10 MHz; times of the select
    // line are all below 50 ns.
    Rules {
        part: "ADXL355",
        base: 0x4001_3000,
        clock: 1,
        select: ('A', 4),
        wires: [('A', 5), ('A', 6), ('A', 7)],
        function: 5,
        mode: 0b00,
        hz: [100_000, 10_000_000],
        burst_hz: None,
        setup_ns: 50,
        hold_ns: 50,
        apart_ns: 50,
        bytes: None,
        stall_ns: 0,
    },
    // ams, AS5048A/AS5048B, v1-11, SPI timing: mode 1, a clock period of 100 ns at least, 350 ns from the select line to the first edge
    // and between two selections, half a clock's period after the last; frames of 16 bits.
    Rules {
        part: "AS5048A",
        base: 0x4000_3800,
        clock: 0,
        select: ('B', 12),
        wires: [('B', 13), ('B', 14), ('B', 15)],
        function: 5,
        mode: 0b01,
        hz: [0, 10_000_000],
        burst_hz: None,
        setup_ns: 350,
        hold_ns: 50,
        apart_ns: 350,
        bytes: Some(2),
        stall_ns: 0,
    },
    // Analog Devices, ADIS16505, revision B, timing specifications: mode 3, 0.1 to 2.1 MHz, in a burst at most 1.1 MHz; 200 ns from the
    // select line to the first edge, a stall of 16 µs between frames.
    Rules {
        part: "ADIS16505",
        base: 0x4000_3C00,
        clock: 0,
        select: ('A', 15),
        wires: [('C', 10), ('C', 11), ('C', 12)],
        function: 6,
        mode: 0b11,
        hz: [100_000, 2_100_000],
        burst_hz: Some((0x68, 1_100_000)),
        setup_ns: 200,
        hold_ns: 0,
        apart_ns: 0,
        bytes: None,
        stall_ns: 16_000,
    },
];

/// A bus as it was seen last.
#[derive(Debug)]
pub struct Bus {
    rules: Rules,
    /// Since when the select line is as it is, ns; `None` where it is not an output yet.
    selected: Option<(bool, u64)>,
    /// Bytes since it went low.
    bytes: u64,
    /// When the last bit is over, ns.
    over_ns: u64,
    /// Since the last byte was taken the core has seen that the bus is not busy: the emulator's byte is over when it comes, a chip's half a clock later.
    looked: bool,
}

impl Bus {
    pub fn new(rules: Rules) -> Self {
        Self { rules, selected: None, bytes: 0, over_ns: 0, looked: true }
    }

    /// The core has written to a register.
    pub fn written(&mut self, chip: &mut Chip<'_>, address: u64, ledger: &Ledger) {
        let (port, _) = self.rules.select;
        if address == self.rules.base + DR {
            self.transfer(chip, ledger);
        } else if address & !0x3FF == super::port_base(port) {
            self.select(chip, ledger);
        }
    }

    /// The core has read this from a register.
    pub fn read(&mut self, address: u64, value: u64) {
        if address == self.rules.base + DR {
            self.looked = false;
        } else if address == self.rules.base + SR {
            self.looked |= value & BUSY == 0;
        }
    }

    fn select(&mut self, chip: &mut Chip<'_>, ledger: &Ledger) {
        let Rules { part, select, .. } = self.rules;
        let (port, number) = select;
        if chip.pin(select).0 != 1 {
            self.selected = None;
            return;
        }
        let low = chip.register(super::port_base(port) + ODR) >> number & 1 == 0;
        let at = chip.at.0;
        match self.selected {
            None => ledger.must(!low, || format!("{part}: the select line is low as soon as it is an output")),
            Some((was, _)) if was == low => return,
            Some((_, since)) if low => {
                ledger.least(&format!("{part}: the select line high"), at - since, self.rules.apart_ns);
                self.bytes = 0;
            }
            Some(_) => self.deselect(chip, ledger),
        }
        self.selected = Some((low, at));
    }

    fn deselect(&mut self, chip: &mut Chip<'_>, ledger: &Ledger) {
        let Rules { part, base, hold_ns, bytes, .. } = self.rules;
        let busy = chip.register(base + SR) & BUSY != 0;
        ledger.must(!busy && chip.at.0 >= self.over_ns, || format!("{part}: the select line rises in the last bit"));
        ledger.must(self.looked, || {
            format!("{part}: the select line rises, and nobody has looked whether the last bit is over")
        });
        ledger.least(&format!("{part}: select line after the last bit"), chip.at.0 - self.over_ns, hold_ns);
        let count = self.bytes;
        ledger.must(bytes.is_none_or(|bytes| bytes == count), || format!("{part}: {count} bytes in a frame"));
    }

    fn transfer(&mut self, chip: &mut Chip<'_>, ledger: &Ledger) {
        let Rules { part, base, clock, mode, function, wires, .. } = self.rules;
        let control = chip.register(base + CR1);
        ledger.must(control & MODE == mode, || format!("{part}: SPI mode {:02b}, not {mode:02b}", control & MODE));
        ledger.must(control & ON == ON && control & OFF == 0, || format!("{part}: SPI set to {control:04x}"));
        for wire in wires {
            ledger.must(chip.pin(wire) == (2, function), || format!("{part}: pin {wire:?} is not the bus's"));
        }
        let hz = chip.bus_hz()[clock] >> ((control >> 3 & 0b111) + 1);
        let [least, most] = self.rules.hz;
        ledger.must((least..=most).contains(&hz), || format!("{part}: a clock of {hz} Hz, of {least} to {most}"));
        let Some((true, since)) = self.selected else {
            return ledger.violation(format!("{part}: a byte while it is not selected"));
        };
        let at = chip.at.0;
        if self.bytes == 0 {
            ledger.least(&format!("{part}: select line before the first bit"), at - since, self.rules.setup_ns);
            ledger.least(
                &format!("{part}: stall between frames"),
                at.saturating_sub(self.over_ns),
                self.rules.stall_ns,
            );
        }
        if let Some((command, most)) = self.rules.burst_hz
            && self.bytes == 2
        {
            // Frames have two bytes: this is a burst.
            ledger.must(hz <= most, || format!("{part}: a clock of {hz} Hz in burst {command:02x}, at most {most}"));
        }
        self.bytes += 1;
        self.over_ns = at.max(self.over_ns) + BITS * 1_000_000_000 / hz.max(1);
    }
}

//! The pulses by which gyro and block sample: both at a rising edge, at the beginning of a tick.

use super::{Chip, Ledger, Pin};

const CR1: u64 = 0x00;
const CNT: u64 = 0x24;
const PSC: u64 = 0x28;
const ARR: u64 = 0x2C;
const CCMR1: u64 = 0x18;
const CCER: u64 = 0x20;
const CCR1: u64 = 0x34;
/// Channel 1 as PWM in mode 1: high from the counter's beginning to its comparison; on, and not inverted (RM0090, 18.4.7, 18.4.9).
const PWM_1: u64 = 0b110 << 4;
const OUTPUT_MODE: u64 = 0b111 << 4 | 0b11;
const ON_INVERTED: u64 = 0b11;
const ON: u64 = 0b01;
/// How long the pulses are high, ns. ADIS16505, revision B, timing specifications: at least 5 µs. KVH 1775 IMU, 56-0298 revision B, table 10-1: at
/// least 30 µs, and less than some 90.
const BLOCK_HIGH_NS: [u64; 2] = [5_000, u64::MAX];
const GYRO_HIGH_NS: [u64; 2] = [30_000, 90_000];
/// The edges of both are so near to each other, cycles of the timers' clock: one of the slower timer's counts, and what lies between the
/// instructions that start them.
const TOGETHER: u64 = 60;

struct Pulse {
    name: &'static str,
    timer: u64,
    pin: Pin,
    function: u64,
    high_ns: [u64; 2],
}

const GYRO: Pulse =
    Pulse { name: "gyro's pulse", timer: 0x4000_0000, pin: ('A', 0), function: 1, high_ns: GYRO_HIGH_NS };
const BLOCK: Pulse =
    Pulse { name: "block's pulse", timer: 0x4000_0800, pin: ('B', 6), function: 2, high_ns: BLOCK_HIGH_NS };

/// Called while the timers run.
pub fn look(chip: &mut Chip<'_>, ledger: &Ledger) {
    let timer_hz = 2 * chip.bus_hz()[0];
    for Pulse { name, timer, pin, function, high_ns: [least_ns, most_ns] } in [GYRO, BLOCK] {
        ledger.must(chip.pin(pin) == (2, function), || format!("{name}: pin {pin:?} is not the timer's"));
        let mode = chip.register(timer + CCMR1) & OUTPUT_MODE;
        let output = chip.register(timer + CCER) & ON_INVERTED;
        ledger
            .must((mode, output) == (PWM_1, ON), || format!("{name} does not rise at the tick: {mode:x}, {output:x}"));
        let high = chip.register(timer + CCR1) * (chip.register(timer + PSC) + 1);
        let high_ns = high * 1_000_000_000 / timer_hz.max(1);
        ledger.least(&format!("{name} high"), high_ns, least_ns);
        ledger.must(high_ns <= most_ns, || format!("{name}: high for {high_ns} ns, at most {most_ns}"));
    }
    if chip.register(GYRO.timer + CR1) & 1 == 0 {
        return;
    }
    let period = chip.register(GYRO.timer + ARR) + 1;
    let gyro = chip.register(GYRO.timer + CNT);
    let block = chip.register(BLOCK.timer + CNT) * (chip.register(BLOCK.timer + PSC) + 1) % period;
    let apart = gyro.abs_diff(block);
    ledger.must(apart.min(period - apart) <= TOGETHER, || format!("the pulses are {apart} cycles apart"));
}

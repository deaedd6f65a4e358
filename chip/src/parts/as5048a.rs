//! ams, AS5048A/AS5048B, data sheet v1-11: SPI frames, register map.

use super::Part;
use crate::witness::Ledger;

const PART: &str = "AS5048A";
const PARITY: u16 = 1 << 15;
const READ: u16 = 1 << 14;
const ERROR: u16 = 1 << 14;
const DATA: u16 = 0x3FFF;
const CLEAR_ERROR: u16 = 0x0001;
const DIAGNOSTICS: u16 = 0x3FFD;
const ANGLE: u16 = 0x3FFF;
/// Diagnostics: offset compensation finished; magnetic field too weak (COMP high).
const OFFSET_COMPENSATED: u16 = 1 << 8;
const COMP_HIGH: u16 = 1 << 11;
const GAIN: u16 = 0x00FF;

/// What the next frame answers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    /// Data without parity.
    Data(u16),
    /// An angle, which the simulated device measures; or what is left to it.
    World,
    /// Diagnostics: the gain is the simulated device's.
    Diagnostics,
}

#[derive(Debug)]
pub struct As5048a {
    answer: Answer,
    failed: bool,
    /// The magnet is weak: COMP high.
    weak: bool,
    /// The first byte of the simulated device's frame.
    world: u8,
}

impl As5048a {
    pub fn new(weak: bool) -> Self {
        Self { answer: Answer::Data(0), failed: false, weak, world: 0 }
    }
}

fn with_parity(word: u16) -> u16 {
    word | if word.count_ones() % 2 == 1 { PARITY } else { 0 }
}

impl Part for As5048a {
    fn answer(&mut self, mosi: &[u8], world: u8, _: u64, ledger: &Ledger) -> u8 {
        let first = mosi.len() == 1;
        match self.answer {
            Answer::World => world,
            Answer::Data(data) => {
                let [high, low] = with_parity(data).to_be_bytes();
                super::agreed(PART, if first { high } else { low }, world, ledger)
            }
            Answer::Diagnostics if self.weak && !matches!(world, 0x00 | 0xFF) => {
                // One more bit, so that the parity is the other one.
                let [flags, _] = COMP_HIGH.to_be_bytes();
                if first { world ^ flags ^ PARITY.to_be_bytes()[0] } else { world }
            }
            Answer::Diagnostics => {
                if first {
                    self.world = world;
                } else {
                    let frame = u16::from_be_bytes([self.world, world]);
                    let flags = frame & DATA & !GAIN;
                    let whole = matches!(frame, 0 | 0xFFFF) || with_parity(frame & !PARITY) == frame;
                    if !whole || !matches!(frame, 0 | 0xFFFF) && flags & OFFSET_COMPENSATED == 0 {
                        ledger.violation(format!("{PART}: diagnostics {frame:04x} of the simulated device"));
                    }
                }
                world
            }
        }
    }

    fn end(&mut self, mosi: &[u8], _: u64, ledger: &Ledger) {
        let &[high, low] = mosi else { return };
        let frame = u16::from_be_bytes([high, low]);
        if frame.count_ones() % 2 == 1 {
            ledger.violation(format!("{PART}: a frame {frame:04x} of odd parity"));
            self.failed = true;
        }
        let error = if self.failed { ERROR } else { 0 };
        self.answer = match (frame & READ != 0, frame & DATA) {
            (true, DIAGNOSTICS) => Answer::Diagnostics,
            (true, CLEAR_ERROR) => {
                self.failed = false;
                Answer::World
            }
            (true, ANGLE) => Answer::World,
            (_, 0) => Answer::Data(error),
            (_, address) => {
                ledger.violation(format!("{PART}: register {address:04x} is not to be used"));
                Answer::World
            }
        };
    }
}

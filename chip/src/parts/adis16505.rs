//! Analog Devices, ADIS16505, data sheet revision B: frames, bursts, DIAG_STAT, MSC_CTRL, UP_SCALE, DEC_RATE. That registers which the part acts
//! on take up to 0.2 ms before they are read back: its driver in Linux (drivers/iio/imu/adis16475.c) waits 0.25 ms.

use super::Part;
use crate::witness::Ledger;

const PART: &str = "ADIS16505";
const DIAG_STAT: u8 = 0x02;
const MSC_CTRL: u8 = 0x60;
const UP_SCALE: u8 = 0x62;
const DEC_RATE: u8 = 0x64;
const BURST: u8 = 0x68;
const ACTED_ON_NS: u64 = 200_000;
/// MSC_CTRL: the synchronisation mode, scaled in 10; sampled at the rising edge.
const MODE: u16 = 0b111 << 2;
const SCALED: u16 = 0b010 << 2;
const RISING: u16 = 1 << 1;
const SUMMED: usize = 32;
/// Of a burst of 32 bits, where each increment has its lower word first: the upper word of the increment of velocity along z, 100 m/s of
/// 2³¹. A block that stands upright has 0.098 m/s in 10 ms, 20 hexadecimal; half of that and one and a half times as much.
const Z_VELOCITY_UPPER: usize = 26;
const UPRIGHT: std::ops::RangeInclusive<u16> = 0x10..=0x30;

#[derive(Debug)]
pub struct Adis16505 {
    /// UP_SCALE, DEC_RATE and MSC_CTRL: as they were before and as they are since then.
    registers: [(u8, u16, u16); 3],
    written_ns: u64,
    /// Which register the next frame answers.
    asked: Option<u8>,
    /// An error flag that is raised at this time, ns, and stays until it is read.
    fault: Option<(u64, u16)>,
    flags: u16,
    /// What is added to the bytes of the burst under way.
    added: u16,
    sum: u16,
    /// The first byte of a word of the burst under way.
    upper: u8,
}

impl Adis16505 {
    pub fn new(fault: Option<(u64, u16)>) -> Self {
        let registers = [(UP_SCALE, 0x07D0, 0x07D0), (DEC_RATE, 0, 0), (MSC_CTRL, 0x00C1, 0x00C1)];
        Self { registers, written_ns: 0, asked: None, fault, flags: 0, added: 0, sum: 0, upper: 0 }
    }

    fn raise(&mut self, at_ns: u64) {
        if let Some((_, flags)) = self.fault.take_if(|(from_ns, _)| at_ns >= *from_ns) {
            self.flags |= flags;
        }
    }

    fn burst(&mut self, mosi: &[u8], world: u8, at_ns: u64, ledger: &Ledger) -> u8 {
        let number = mosi.len() - 1;
        match number {
            Z_VELOCITY_UPPER => self.upper = world,
            _ if number == Z_VELOCITY_UPPER + 1 => {
                let upper = u16::from_be_bytes([self.upper, world]);
                if !UPRIGHT.contains(&upper) && !matches!(upper, 0 | 0xFFFF) {
                    ledger.violation(format!(
                        "{PART}: the simulated device lies, or has its words in another order: {upper:04x}"
                    ));
                }
            }
            _ => {}
        }
        if number == 2 {
            self.raise(at_ns);
            (self.added, self.sum) = (self.flags, 0);
        }
        let [high, low] = self.added.to_be_bytes();
        let answer = match number {
            2 => world | high,
            3 => world | low,
            SUMMED if self.added != 0 => self.sum.to_be_bytes()[0],
            33 if self.added != 0 => self.sum.to_be_bytes()[1],
            _ => world,
        };
        if (2..SUMMED).contains(&number) {
            self.sum = self.sum.wrapping_add(answer.into());
        }
        answer
    }

    fn control(&self) -> u16 {
        self.registers[2].2
    }
}

impl Part for Adis16505 {
    fn answer(&mut self, mosi: &[u8], world: u8, at_ns: u64, ledger: &Ledger) -> u8 {
        if mosi.len() > 2 && mosi[0] == BURST {
            return self.burst(mosi, world, at_ns, ledger);
        }
        let Some(address) = self.asked else { return world };
        let half = mosi.len() - 1;
        if address == DIAG_STAT {
            return world | self.flags.to_be_bytes().get(half).copied().unwrap_or(0);
        }
        let Some((_, before, now)) = self.registers.iter().find(|(register, ..)| *register == address) else {
            return world;
        };
        let busy = at_ns < self.written_ns + ACTED_ON_NS;
        let own = if busy { before } else { now }.to_be_bytes();
        let own = own.get(half).copied().unwrap_or(0);
        if busy { own } else { super::agreed(PART, own, world, ledger) }
    }

    fn end(&mut self, mosi: &[u8], at_ns: u64, ledger: &Ledger) {
        if mosi.len() > 2 {
            let scaled = self.control() & MODE == SCALED;
            if scaled && self.control() & RISING == 0 {
                ledger.violation(format!("{PART}: it samples at the pulse's falling edge"));
            }
            if mosi.len() != SUMMED + 2 {
                ledger.violation(format!("{PART}: a burst of {} bytes", mosi.len()));
            }
            return;
        }
        let &[command, data] = mosi else { return ledger.violation(format!("{PART}: half a frame")) };
        if self.asked.take() == Some(DIAG_STAT) {
            self.flags = 0;
        }
        let address = command & 0x7F;
        if command & 0x80 == 0 {
            self.raise(at_ns);
            self.asked = Some(address & !1);
            return;
        }
        for (register, before, now) in self.registers.iter_mut().filter(|(register, ..)| *register == address & !1) {
            if address == *register {
                *before = *now;
            }
            let [high, low] = now.to_be_bytes();
            *now = u16::from_be_bytes(if address == *register { [high, data] } else { [data, low] });
            self.written_ns = at_ns;
        }
    }
}

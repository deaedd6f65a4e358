//! Analog Devices, ADXL354/ADXL355, data sheet revision B: register map, "Measurement mode", "Serial communications".

use super::Part;
use crate::witness::Ledger;

const PART: &str = "ADXL355";
const IDENTITY: [u8; 3] = [0xAD, 0x1D, 0xED];
const STATUS: usize = 0x04;
/// Of STATUS: a measurement that was not read yet.
const DATA_READY: u8 = 1;
const XDATA3: usize = 0x08;
const ZDATA1: usize = 0x10;
const FIRST_WRITABLE: usize = 0x1E;
const FILTER: usize = 0x28;
const RANGE: usize = 0x2C;
const POWER_CTL: usize = 0x2D;
const SELF_TEST: usize = 0x2E;
const STANDBY: u8 = 1;

#[derive(Debug)]
pub struct Adxl355 {
    registers: [u8; 0x30],
    /// From when on it measures no more, ns.
    stops_ns: u64,
}

impl Adxl355 {
    /// After power-up: in standby, ±2 g, interrupts active low, I²C fast.
    pub fn new(stops_ns: u64) -> Self {
        let mut registers = [0; 0x30];
        (registers[RANGE], registers[POWER_CTL]) = (0x81, STANDBY);
        Self { registers, stops_ns }
    }
}

/// The address at which a transaction begins, and whether it reads.
fn command(mosi: &[u8]) -> (usize, bool) {
    mosi.first().map_or((0, false), |command| (usize::from(command >> 1), command & 1 == 1))
}

impl Part for Adxl355 {
    fn answer(&mut self, mosi: &[u8], world: u8, at_ns: u64, ledger: &Ledger) -> u8 {
        let (from, reads) = command(mosi);
        let Some(number) = mosi.len().checked_sub(2).filter(|_| reads) else { return world };
        if from + number == STATUS && at_ns >= self.stops_ns {
            return world & !DATA_READY;
        }
        let own = match from + number {
            address @ 0..3 => IDENTITY[address],
            address @ (FILTER | RANGE | POWER_CTL | SELF_TEST) => self.registers[address],
            _ => return world,
        };
        super::agreed(PART, own, world, ledger)
    }

    fn end(&mut self, mosi: &[u8], _: u64, ledger: &Ledger) {
        let (from, reads) = command(mosi);
        let places = from..from + mosi.len() - 1;
        if reads {
            let axes = (XDATA3..=ZDATA1).filter(|address| places.contains(address)).count();
            if !matches!(axes, 0 | 9) {
                ledger.violation(format!("{PART}: axes are read in pieces, of different samples"));
            }
            return;
        }
        for (address, &value) in places.zip(&mosi[1..]) {
            let measures = self.registers[POWER_CTL] & STANDBY == 0;
            if measures && (FIRST_WRITABLE..POWER_CTL).contains(&address) {
                ledger.violation(format!("{PART}: register {address:02x} is written while it measures"));
            }
            if let Some(register) = self.registers.get_mut(address) {
                *register = value;
            }
        }
    }
}

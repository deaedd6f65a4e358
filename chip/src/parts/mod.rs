//! The parts on the SPI buses as their data sheets describe their registers, before the simulated devices, which give what is measured. Written
//! apart from those and from the drivers: where the two models say different things, that is a finding, but for a simulated bus that is broken
//! (zeros, or ones).

mod adis16505;
mod adxl355;
mod as5048a;

pub use adis16505::Adis16505;
pub use adxl355::Adxl355;
pub use as5048a::As5048a;
use std::fmt::Debug;

use crate::witness::Ledger;

/// A part's registers.
pub trait Part: Debug + Send + 'static {
    /// What comes back with the last of these bytes; `world` is what the simulated device answers.
    fn answer(&mut self, mosi: &[u8], world: u8, at_ns: u64, ledger: &Ledger) -> u8;
    /// The select line rises after these bytes.
    fn end(&mut self, mosi: &[u8], at_ns: u64, ledger: &Ledger);
}

/// What the registers say, held against the simulated device.
fn agreed(part: &str, own: u8, world: u8, ledger: &Ledger) -> u8 {
    if own == world {
        return own;
    }
    let broken = matches!(world, 0x00 | 0xFF);
    if !broken {
        ledger.violation(format!("{part}: the data sheet says {own:02x}, the simulated device {world:02x}"));
    }
    world
}

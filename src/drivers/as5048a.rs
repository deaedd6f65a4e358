//! AS5048A, the 14-bit absolute angle encoder, on SPI (mode 1, at most 10 MHz, 16-bit frames).
//!
//! Every frame carries an even parity bit, and the answer to a frame comes with the next one. So a reading asks for the
//! angle, and asks for the diagnostics while it takes the angle; the diagnostics come with the next reading's first
//! frame. No angle counts without diagnostics that vouch for it: a bus that is stuck low answers with zeros, whose parity is
//! right.
//!
//! Source: ams, "AS5048A/AS5048B", data sheet v1-11.

use embedded_hal::spi::SpiDevice;
use quantities::codes::IndexCode;

const CLEAR_ERROR: u16 = 0x0001;
const DIAGNOSTICS: u16 = 0x3FFD;
const ANGLE: u16 = 0x3FFF;

const PARITY: u16 = 0x8000;
const READ: u16 = 0x4000;
/// In an answer: the part saw a bad frame; stays until it is cleared.
const ERROR_FLAG: u16 = 0x4000;
const DATA: u16 = 0x3FFF;

/// Offset compensation finished: the angle is meant.
const COMPENSATED: u16 = 0x0100;
/// The angle computation overflowed: the angle is invalid.
const OVERFLOW: u16 = 0x0200;

/// Codes of 14 bits.
const BITS: u32 = 14;

/// The encoder.
#[derive(Debug)]
pub struct As5048a<SPI> {
    spi: SPI,
    /// Whether the next answer is the diagnostics register, asked for by the reading before.
    diagnostics_asked: bool,
}

/// What went wrong with the encoder. `E` is the bus's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error<E> {
    Bus(E),
    /// The answer's parity is odd.
    Parity {
        frame: u16,
    },
    /// The part says that it received a bad frame. The flag has been cleared.
    Flagged,
    /// The part says that its angle means nothing: starting, magnet too near or missing.
    Invalid {
        diagnostics: u16,
    },
}

impl<SPI: SpiDevice> As5048a<SPI> {
    pub fn new(spi: SPI) -> Self {
        Self { spi, diagnostics_asked: false }
    }

    /// The angle now, rising counter-clockwise from above.
    ///
    /// After an error the next reading starts afresh.
    pub fn angle(&mut self) -> Result<IndexCode, Error<SPI::Error>> {
        if !core::mem::take(&mut self.diagnostics_asked) {
            self.ask(DIAGNOSTICS)?;
        }
        let answer = self.ask(ANGLE)?;
        let diagnostics = self.checked(answer)?;
        let answer = self.ask(DIAGNOSTICS)?;
        let code = self.checked(answer)?;
        self.diagnostics_asked = true;
        if diagnostics & (COMPENSATED | OVERFLOW) == COMPENSATED {
            Ok(IndexCode(u32::from(code) << (u32::BITS - BITS)))
        } else {
            Err(Error::Invalid { diagnostics })
        }
    }

    /// The data of a good answer.
    fn checked(&mut self, answer: u16) -> Result<u16, Error<SPI::Error>> {
        if !answer.count_ones().is_multiple_of(2) {
            return Err(Error::Parity { frame: answer });
        }
        if answer & ERROR_FLAG != 0 {
            self.ask(CLEAR_ERROR)?;
            return Err(Error::Flagged);
        }
        Ok(answer & DATA)
    }

    /// Asks for a register; gives the answer to the frame before.
    fn ask(&mut self, register: u16) -> Result<u16, Error<SPI::Error>> {
        let mut frame = even_parity(READ | register).to_be_bytes();
        self.spi.transfer_in_place(&mut frame).map_err(Error::Bus)?;
        Ok(u16::from_be_bytes(frame))
    }
}

fn even_parity(frame: u16) -> u16 {
    if frame.count_ones().is_multiple_of(2) { frame } else { frame | PARITY }
}

#[cfg(test)]
mod tests {
    use super::super::mock::{Exchange, MockSpi};
    use super::*;
    extern crate std;
    use std::vec;

    fn frame(mosi: u16, miso: u16) -> Exchange {
        Exchange::new(mosi.to_be_bytes(), miso.to_be_bytes())
    }

    /// The first of all readings begins by asking for the diagnostics: 0x7FFD has 14 ones. Its answer means nothing.
    const FIRST: u16 = 0x7FFD;
    /// Compensated, gain 0x80: 0x0180 has two ones.
    const GOOD: u16 = 0x0180;

    #[test]
    fn angle_by_hand_calculation() {
        // Asking for the angle: 0x3FFF with the read bit is 0x7FFF, 15 ones, so the parity bit makes 0xFFFF. 90 degrees
        // is 4096 = 0x1000, one 1, so 0x9000 with parity.
        let mut spi = MockSpi::new(vec![frame(FIRST, 0x0000), frame(0xFFFF, GOOD), frame(0x7FFD, 0x9000)]);
        assert_eq!(As5048a::new(&mut spi).angle(), Ok(IndexCode(1 << 30)));
        spi.done();
    }

    #[test]
    fn the_highest_code_is_just_below_a_turn() {
        let mut spi = MockSpi::new(vec![frame(FIRST, 0x0000), frame(0xFFFF, GOOD), frame(0x7FFD, 0x3FFF)]);
        assert_eq!(As5048a::new(&mut spi).angle(), Ok(IndexCode(0x3FFF << 18)));
    }

    #[test]
    fn diagnostics_come_with_the_next_reading() {
        // Without the compensation bit: 0x0080, one 1, so 0x8080.
        let mut spi = MockSpi::new(vec![
            frame(FIRST, 0x0000),
            frame(0xFFFF, GOOD),
            frame(0x7FFD, 0x0000),
            frame(0xFFFF, GOOD),
            frame(0x7FFD, 0x0003),
            frame(0xFFFF, 0x8080),
            frame(0x7FFD, 0x0003),
        ]);
        let mut encoder = As5048a::new(&mut spi);
        assert_eq!(encoder.angle(), Ok(IndexCode(0)));
        assert_eq!(encoder.angle(), Ok(IndexCode(3 << 18)));
        assert_eq!(encoder.angle(), Err(Error::Invalid { diagnostics: 0x0080 }));
    }

    #[test]
    fn odd_parity_is_an_error_and_the_next_reading_starts_afresh() {
        let mut spi = MockSpi::new(vec![
            frame(FIRST, 0x0000),
            frame(0xFFFF, GOOD),
            frame(0x7FFD, 0x1000),
            frame(FIRST, GOOD),
            frame(0xFFFF, GOOD),
            frame(0x7FFD, 0x9000),
        ]);
        let mut encoder = As5048a::new(&mut spi);
        assert_eq!(encoder.angle(), Err(Error::Parity { frame: 0x1000 }));
        assert_eq!(encoder.angle(), Ok(IndexCode(1 << 30)));
    }

    #[test]
    fn the_error_flag_is_cleared() {
        // Flag and parity: 0xC000. Clearing reads register 1: 0x4001, two ones.
        let mut spi =
            MockSpi::new(vec![frame(FIRST, 0x0000), frame(0xFFFF, GOOD), frame(0x7FFD, 0xC000), frame(0x4001, GOOD)]);
        assert_eq!(As5048a::new(&mut spi).angle(), Err(Error::Flagged));
        spi.done();
    }

    #[test]
    fn a_bus_stuck_high_is_an_error() {
        let stuck = vec![frame(FIRST, 0xFFFF), frame(0xFFFF, 0xFFFF), frame(0x4001, 0xFFFF)];
        assert_eq!(As5048a::new(&mut MockSpi::new(stuck)).angle(), Err(Error::Flagged));
    }

    #[test]
    fn a_bus_stuck_low_is_an_error_at_every_reading() {
        let mut spi =
            MockSpi::new([FIRST, 0xFFFF, 0x7FFD, 0xFFFF, 0x7FFD].into_iter().map(|mosi| frame(mosi, 0x0000)).collect());
        let mut encoder = As5048a::new(&mut spi);
        assert_eq!(encoder.angle(), Err(Error::Invalid { diagnostics: 0 }));
        assert_eq!(encoder.angle(), Err(Error::Invalid { diagnostics: 0 }));
    }
}

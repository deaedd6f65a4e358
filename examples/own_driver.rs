//! A driver for an encoder that the project does not know, over embedded-hal, and what the firmware makes of its readings.
//!
//! `cargo run --example own_driver --no-default-features`
//!
//! A driver needs no trait of the project: it gives an [`IndexCode`], which a board hands to the instrument as [`Due::Index`] at every fourth
//! tick (100 Hz). Here the chip is an AMT22-like 14-bit encoder: two bytes, bits 13 … 0 the angle, bits 15 and 14 odd parity of the odd and of the
//! even bits.

use std::convert::Infallible;

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use north_finder::drivers::sensors::Due;
use north_finder::sensing::index::IndexMean;
use quantities::codes::IndexCode;

/// The driver.
struct Amt22<S> {
    spi: S,
}

/// Why it has no angle.
#[derive(Debug)]
enum Error<E> {
    Bus(E),
    Parity(u16),
}

impl<S: SpiDevice> Amt22<S> {
    /// The angle now. Errors: of the bus, or a word whose parity is wrong.
    fn angle(&mut self) -> Result<IndexCode, Error<S::Error>> {
        let mut word = [0; 2];
        self.spi.transfer_in_place(&mut word).map_err(Error::Bus)?;
        let word = u16::from_be_bytes(word);
        let odd = |mask: u16| (word & mask).count_ones() % 2 == 1;
        if !(odd(0xAAAA) && odd(0x5555)) {
            return Err(Error::Parity(word));
        }
        // Fourteen bits of a turn, in 2⁻³² of one. The chip counts clockwise from above, the index angle counter-clockwise.
        Ok(IndexCode((u32::from(word & 0x3FFF) << 18).wrapping_neg()))
    }
}

/// The chip, standing at an angle, in place of a bus.
struct Chip {
    clockwise_deg: f64,
    /// Every so many readings one bit is wrong.
    wrong_every: u32,
    readings: u32,
}

impl ErrorType for Chip {
    type Error = Infallible;
}

impl SpiDevice for Chip {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.readings += 1;
        let angle = (self.clockwise_deg / 360.0 * 16384.0).round() as u16 & 0x3FFF;
        let parity = |mask: u16| u16::from((angle & mask).count_ones().is_multiple_of(2));
        let mut word = angle | parity(0x2AAA) << 15 | parity(0x1555) << 14;
        if self.readings.is_multiple_of(self.wrong_every) {
            word ^= 1;
        }
        for operation in operations {
            if let Operation::TransferInPlace(bytes) = operation {
                bytes.copy_from_slice(&word.to_be_bytes());
            }
        }
        Ok(())
    }
}

fn main() {
    let mut encoder = Amt22 { spi: Chip { clockwise_deg: 270.0, wrong_every: 25, readings: 0 } };
    let (mut second, mut refused) = (IndexMean::default(), 0);
    for _ in 0..100 {
        let angle = encoder.angle();
        match &angle {
            Ok(_) => {}
            Err(Error::Parity(word)) => {
                println!("the word {word:#06x} has the wrong parity");
                refused += 1;
            }
            Err(Error::Bus(never)) => match *never {},
        }
        // What a board hands over; a reading that failed is `None`, and enough of them in a row are a fault.
        if let Due::Index(Some(index)) = Due::Index(angle.ok()) {
            second.push(index);
        }
    }
    match second.finish_deg() {
        Some(index_deg) => println!("index {index_deg:.3}°, {refused} readings of 100 refused"),
        None => println!("no reading"),
    }
}

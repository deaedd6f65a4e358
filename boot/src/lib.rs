//! Update in the field: an image comes signed, into the slot that is not running; the loader tries it, and goes back where it does not start.
//!
//! | sector of the STM32F405 | holds |
//! |---|---|
//! | 0 (16 KiB) | the loader |
//! | 1, 2 (16 KiB each) | the settings, which no update touches |
//! | 5, 6, 7 (128 KiB each) | slot A, from [`SLOTS`] on |
//! | 8, 9, 10 (128 KiB each) | slot B |
//!
//! Every release is linked twice, once for each slot: nothing is copied or exchanged, and the image that runs is never erased. What is known of a slot
//! is in its own last 256 bytes ([`slot`]), in words that are written once: there is no state elsewhere that a power cut could tear from it.
//!
//! A loader that exchanges both slots (embassy-boot 0.6) was looked at: it wants the second slot larger than the first by the largest sector, 128 KiB
//! here, and so all of the flash from sector 5 to 11, without a log; it erases every sector four times in an update and a return; and its partitions have
//! pages of one size.

#![no_std]

#[cfg(test)]
extern crate std;

pub mod choice;
pub mod manifest;
pub mod parts;
pub mod receive;
pub mod slot;

use crc::{CRC_32_ISO_HDLC, Crc, Table};

/// Where the slots are.
pub const SLOTS: [u32; 2] = [0x0802_0000, 0x0808_0000];
/// Bytes of a slot.
pub const SLOT_BYTES: u32 = 384 * 1024;
/// Bytes of a slot's sectors.
pub const SECTOR_BYTES: u32 = 128 * 1024;

/// The CRC-32 of Ethernet and zlib (CRC-32/ISO-HDLC): of seals and images, settings, kept crashes, error models and the
/// frames of the host's link.
pub static CRC_32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

#[cfg(test)]
mod tests {
    use super::CRC_32;

    /// The check value in the catalogue of parametrised CRCs.
    #[test]
    fn the_crc_of_the_digits_is_that_of_the_catalogue() {
        assert_eq!(CRC_32.checksum(b"123456789"), 0xCBF4_3926);
    }
}

//! Update in the field: an image comes over the link into the slot that is free.
//!
//! What is in a slot, what is signed and which slot is started: [`north_boot`].

use embedded_storage::nor_flash::NorFlash;
use north_boot::manifest::Key;
use north_boot::receive::{Place, Receiver, Refused};
use north_boot::slot::{self, Seal};

use crate::event::identity::Board;
use crate::health::Refusal;
use crate::settings::access::PublicKey;

/// Ticks after which an image that was tried confirms itself: ten seconds, in which settings were read, every task has checked in with the
/// watchdog, and a crash or a hang would have started the loader again.
pub const CONFIRMED_TICKS: u64 = 4000;

/// Both slots of a board.
pub trait Slots: Send {
    /// The address that an image must be linked for to fit the free one.
    fn free_origin(&self) -> u32;
    /// Erases a sector of the free slot. Errors: no manifest has come, or a sector behind it is not erased; the flash.
    fn erase(&mut self, sector: u32) -> Result<(), Refusal>;
    /// Takes a piece of a file; whether it was the last, and the image is the next to start.
    fn take(&mut self, offset: u32, bytes: &[u8]) -> Result<bool, Refusal>;
    /// The image that runs works; whether nothing is left to confirm.
    fn confirm(&mut self) -> bool;
}

/// The slots as flash memory.
pub struct Updater<F> {
    running: F,
    free: F,
    place: Place,
    receiver: Receiver,
}

impl<F: NorFlash> Updater<F> {
    /// `origin` is where the free slot begins. Images are taken that `key` has signed; without one, anybody's.
    pub fn new(board: Board, mut running: F, free: F, origin: u32, key: Option<Key>) -> Self {
        let sequence = Seal::read(&mut running).map_or(0, |seal| seal.sequence);
        let place = Place { board: board as u8, origin, key, sequence };
        Self { running, free, place, receiver: Receiver::default() }
    }

    /// Whether the image that runs is here to stay: confirmed, or brought by a debug probe.
    fn is_confirmed(&mut self) -> bool {
        slot::is_confirmed(&mut self.running) || slot::is_unsealed(&mut self.running)
    }
}

impl<F: NorFlash + Send> Slots for Updater<F> {
    fn free_origin(&self) -> u32 {
        self.place.origin
    }

    fn erase(&mut self, sector: u32) -> Result<(), Refusal> {
        self.receiver.erase(&mut self.free, sector).map_err(Refusal::from)
    }

    fn take(&mut self, offset: u32, bytes: &[u8]) -> Result<bool, Refusal> {
        // Until then the other slot is the way back.
        if offset == 0 && !self.is_confirmed() {
            return Err(Refusal::Unconfirmed);
        }
        self.receiver.take(&mut self.free, &self.place, offset, bytes).map_err(Refusal::from)
    }

    fn confirm(&mut self) -> bool {
        // What a debug probe brought has no seal, and needs no confirmation.
        Seal::read(&mut self.running).is_none() || slot::confirm(&mut self.running)
    }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Self {
        match refused {
            Refused::OutOfOrder => Self::OutOfOrder,
            Refused::Unfit => Self::UpdateUnfit,
            Refused::Unsigned => Self::UpdateUnsigned,
            Refused::NotWritten => Self::NotStored,
        }
    }
}

/// The public key whose images are taken, as it was given when the firmware was built: `NORTH_KEY`, 64 hexadecimal digits, which the build script checks.
pub fn key() -> Option<Key> {
    option_env!("NORTH_KEY").and_then(PublicKey::from_hex).map(|PublicKey(key)| key)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;
    use std::vec::Vec;

    use embedded_storage::nor_flash::{ErrorType, NorFlashErrorKind, ReadNorFlash};
    use north_boot::manifest::{BYTES, Manifest, public};

    use super::*;

    const ORIGIN: u32 = 0x0808_0000;
    const SECRET: [u8; 32] = [5; 32];

    /// A slot of three small sectors.
    struct Slot(Vec<u8>);

    impl ErrorType for Slot {
        type Error = NorFlashErrorKind;
    }

    impl ReadNorFlash for Slot {
        const READ_SIZE: usize = 1;

        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
            bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
            Ok(())
        }

        fn capacity(&self) -> usize {
            self.0.len()
        }
    }

    impl NorFlash for Slot {
        const WRITE_SIZE: usize = 4;
        const ERASE_SIZE: usize = 1024;

        fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
            self.0[from as usize..to as usize].fill(0xFF);
            Ok(())
        }

        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
            self.0[offset as usize..].iter_mut().zip(bytes).for_each(|(place, byte)| *place &= byte);
            Ok(())
        }
    }

    /// An image without a seal has nothing to confirm; where flash takes no confirmation any more, that is said.
    #[test]
    fn a_confirmation_that_does_not_hold_is_told() {
        let free = || Slot(vec![0xFF; 3072]);
        assert!(Updater::new(Board::Stm32f405, free(), free(), ORIGIN, None).confirm());
        let mut running = free();
        running.write(0, &[7; 64]).unwrap();
        let crc = slot::content_crc(&mut running, 64).unwrap();
        assert!(Seal { sequence: 1, length: 64, crc }.write(&mut running));
        // All words of confirmation are spoilt.
        running.write(3072 - 256 + 64, &[0; 32]).unwrap();
        let mut slots = Updater::new(Board::Stm32f405, running, free(), ORIGIN, None);
        assert!(!slots.confirm() && !slots.confirm());
    }

    /// The image that runs was brought by an update; with one on trial there is no other update, and a confirmed one is followed by its successor.
    #[test]
    fn an_image_on_trial_takes_no_update() {
        let mut running = Slot(vec![0xFF; 3072]);
        running.write(0, &[7; 64]).unwrap();
        let crc = slot::content_crc(&mut running, 64).unwrap();
        assert!(Seal { sequence: 41, length: 64, crc }.write(&mut running));
        let mut slots = Updater::new(Board::Stm32f405, running, Slot(vec![0; 3072]), ORIGIN, Some(public(&SECRET)));
        let content = [9; 192];
        let hash = sha2::Digest::finalize(sha2::Digest::chain_update(<sha2::Sha512 as sha2::Digest>::new(), content));
        let manifest = Manifest {
            board: Board::Stm32f405 as u8,
            origin: slots.free_origin(),
            length: 192,
            version: [0; 16],
            revision: [0; 16],
            hash: hash.into(),
        };
        let file = [manifest.signed(&SECRET).as_slice(), &content].concat();
        assert_eq!(slots.take(0, &file[..96]), Err(Refusal::Unconfirmed));
        assert!(slots.confirm());
        assert_eq!(slots.take(0, &file[..96]), Ok(false));
        assert_eq!(slots.take(96, &file[96..BYTES]), Ok(false));
        assert_eq!(slots.take(BYTES as u32, &file[BYTES..BYTES + 96]), Err(Refusal::OutOfOrder));
        for sector in [2, 1, 0] {
            assert_eq!(slots.erase(sector), Ok(()));
        }
        assert_eq!(slots.take(BYTES as u32, &file[BYTES..BYTES + 96]), Ok(false));
        assert_eq!(slots.take(BYTES as u32 + 96, &file[BYTES + 96..]), Ok(true));
        assert_eq!(Seal::read(&mut slots.free).map(|seal| (seal.sequence, seal.length)), Some((42, 192)));
    }
}

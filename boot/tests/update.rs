//! An update with its power cut at every word and every erase: the loader always starts an image that is whole, and the settings stay.

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use north_boot::choice::choose;
use north_boot::manifest::{BYTES, Manifest, public};
use north_boot::receive::{Place, Receiver, Refused};
use north_boot::slot::{self, Seal, TRAILER, TRIALS};
use sha2::{Digest as _, Sha512};

/// Slots as on the board, with sectors of this size in place of 128 KiB.
const SECTOR: usize = 1024;
const SLOT: usize = 3 * SECTOR;
/// Settings, slot A, slot B.
const STARTS: [usize; 3] = [0, 2 * SECTOR, 2 * SECTOR + SLOT];
const ALL: usize = 2 * SECTOR + 2 * SLOT;
const ORIGINS: [u32; 2] = [0x0802_0000, 0x0808_0000];
const BOARD: u8 = 2;
const SECRET: [u8; 32] = [7; 32];

/// NOR flash whose power fails: what is under way then has done a part of its work, at random.
struct Memory {
    bytes: Vec<u8>,
    written: Vec<bool>,
    /// Words and erases that there is power for.
    power: Option<usize>,
    random: u64,
    operations: usize,
}

impl Memory {
    fn random(&mut self) -> u64 {
        // A linear congruential generator (Knuth, MMIX); the upper half is used.
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.random >> 32
    }

    /// Whether there is power for one more; `None`: it fails in the midst of it.
    fn spend(&mut self) -> Result<Option<()>, NorFlashErrorKind> {
        self.operations += 1;
        match &mut self.power {
            None => Ok(Some(())),
            Some(0) => Err(NorFlashErrorKind::Other),
            Some(power) => {
                *power -= 1;
                Ok((*power > 0).then_some(()))
            }
        }
    }
}

/// A region of it.
struct Region {
    memory: Rc<RefCell<Memory>>,
    start: usize,
}

impl ErrorType for Region {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Region {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        assert!(offset as usize + bytes.len() <= SLOT);
        let start = self.start + offset as usize;
        bytes.copy_from_slice(&self.memory.borrow().bytes[start..start + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SLOT
    }
}

impl NorFlash for Region {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        assert!(to as usize <= SLOT && from.is_multiple_of(SECTOR as u32) && to - from == SECTOR as u32);
        let mut memory = self.memory.borrow_mut();
        let whole = memory.spend()?.is_some();
        for at in self.start + from as usize..self.start + to as usize {
            // An erase that is cut leaves any bits.
            memory.bytes[at] = if whole { 0xFF } else { memory.random() as u8 };
            memory.written[at] = !whole;
        }
        if whole { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        assert!(offset as usize + bytes.len() <= SLOT && offset.is_multiple_of(4) && bytes.len().is_multiple_of(4));
        let mut memory = self.memory.borrow_mut();
        for (number, word) in bytes.chunks(4).enumerate() {
            let start = self.start + offset as usize + 4 * number;
            let whole = memory.spend()?.is_some();
            for (at, byte) in (start..).zip(word) {
                assert!(!memory.written[at], "written twice at {at}");
                // Of a word that is cut some bits are written.
                let kept = if whole { 0 } else { memory.random() as u8 };
                memory.bytes[at] &= byte | kept;
                memory.written[at] = true;
            }
            if !whole {
                return Err(NorFlashErrorKind::Other);
            }
        }
        Ok(())
    }
}

/// An image that knows its version and its slot, in its first bytes.
fn image(version: u8, slot: usize) -> Vec<u8> {
    (0..SLOT - TRAILER as usize - 100).map(|at| [version, slot as u8][at % 2] ^ (at / 2) as u8).collect()
}

fn file(version: u8, slot: usize) -> Vec<u8> {
    let content = image(version, slot);
    let manifest = Manifest {
        board: BOARD,
        origin: ORIGINS[slot],
        length: content.len() as u32,
        version: [version; 16],
        revision: [0; 16],
        hash: Sha512::digest(&content).into(),
    };
    [manifest.signed(&SECRET).to_vec(), content].concat()
}

fn place(slot: usize, sequence: u32) -> Place {
    Place { board: BOARD, origin: ORIGINS[slot], key: Some(public(&SECRET)), sequence }
}

/// A board: its flash, with settings, and version 1 sealed and confirmed in slot A.
struct Board(Rc<RefCell<Memory>>);

impl Board {
    fn new(seed: u64) -> Self {
        let memory =
            Memory { bytes: vec![0xFF; ALL], written: vec![false; ALL], power: None, random: seed, operations: 0 };
        let board = Self(Rc::new(RefCell::new(memory)));
        for at in 0..2 * SECTOR {
            board.0.borrow_mut().bytes[at] = (at * 31) as u8;
        }
        let mut slot = board.slot(0);
        let content = image(1, 0);
        slot.write(0, &content).unwrap();
        let crc = slot::content_crc(&mut slot, content.len() as u32).unwrap();
        assert!(Seal { sequence: 1, length: content.len() as u32, crc }.write(&mut slot) && slot::confirm(&mut slot));
        board
    }

    fn slot(&self, number: usize) -> Region {
        Region { memory: self.0.clone(), start: STARTS[1 + number] }
    }

    fn power(&self, operations: Option<usize>) {
        self.0.borrow_mut().power = operations;
    }

    /// Starts: the slot, and the version in it, which must be whole; the settings are as they were.
    fn start(&self) -> (usize, u8) {
        let number = choose(&mut [self.slot(0), self.slot(1)]).expect("an image to start");
        let memory = self.0.borrow();
        let content = &memory.bytes[STARTS[1 + number]..][..image(1, 0).len()];
        let version = content[0];
        assert!(content == image(version, number), "the image in slot {number} is not whole");
        assert!((0..2 * SECTOR).all(|at| memory.bytes[at] == (at * 31) as u8), "settings");
        (number, version)
    }

    /// What the running firmware does with a file that comes; an error where the power fails.
    fn update(&self, running: usize, version: u8) -> Result<(), Refused> {
        let free = 1 - running;
        let sequence = Seal::read(&mut self.slot(running)).unwrap().sequence;
        let (mut receiver, mut flash) = (Receiver::default(), self.slot(free));
        let (place, file) = (place(free, sequence), file(version, free));
        let mut offset = 0;
        for piece in [&file[..96], &file[96..BYTES]] {
            receiver.take(&mut flash, &place, offset, piece)?;
            offset += piece.len() as u32;
        }
        (0..3).rev().try_for_each(|sector| receiver.erase(&mut flash, sector))?;
        let mut done = false;
        for piece in file[BYTES..].chunks(96) {
            done = receiver.take(&mut flash, &place, offset, piece)?;
            offset += piece.len() as u32;
        }
        assert!(done);
        Ok(())
    }
}

/// Words and erases of a whole update with its first start and its confirmation.
fn operations() -> usize {
    let board = Board::new(1);
    let before = board.0.borrow().operations;
    board.update(0, 2).unwrap();
    assert_eq!(board.start(), (1, 2));
    assert!(slot::confirm(&mut board.slot(1)));
    let after = board.0.borrow().operations;
    after - before
}

/// The power fails at every word and erase of an update, with three outcomes of each, and once more somewhere in the next start: a start always, of
/// one version or the other; and the update succeeds when it is repeated.
#[test]
fn power_is_cut_at_every_word() {
    let (mut cuts, mut old, mut new) = (0, 0, 0);
    for seed in 0..3 {
        for cut in 1..=operations() {
            let board = Board::new(1000 * seed + cut as u64);
            board.power(Some(cut));
            if board.update(0, 2).is_ok() {
                let (number, _) = board.start();
                slot::confirm(&mut board.slot(number));
            }
            cuts += 1;
            // The loader's own word may be cut, too.
            board.power(Some(1));
            board.start();
            cuts += 1;
            board.power(None);
            let (running, version) = board.start();
            if version == 2 {
                new += 1;
                assert!(slot::confirm(&mut board.slot(running)));
            } else {
                old += 1;
                board.update(running, 2).unwrap();
                assert_eq!(board.start().1, 2);
            }
        }
    }
    println!("{cuts} power cuts: {old} starts of the old version, {new} of the new one");
    assert!(cuts >= 1000 && old > 0 && new > 0, "{cuts} {old} {new}");
}

/// Updates one after the other, back and forth between the slots, each with power cuts at random: versions go up, and nothing is lost.
#[test]
fn a_life_of_updates() {
    let board = Board::new(9);
    let (mut running, mut version) = board.start();
    for next in 2..60 {
        loop {
            let power = board.0.borrow_mut().random() as usize % 1500;
            board.power(Some(power));
            let updated = board.update(running, next);
            board.power(None);
            let (number, found) = board.start();
            assert!(found == version || found == next, "{found} after {version}");
            if found == next {
                assert!(updated.is_ok() || number != running);
                assert!(slot::confirm(&mut board.slot(number)));
                (running, version) = (number, found);
                break;
            }
        }
    }
    assert_eq!(version, 59);
}

/// An image that never confirms itself is started three times, and then the former one for good.
#[test]
fn an_image_that_does_not_start_is_taken_back() {
    let board = Board::new(3);
    board.update(0, 2).unwrap();
    for _ in 0..TRIALS {
        assert_eq!(board.start(), (1, 2));
    }
    for _ in 0..10 {
        assert_eq!(board.start(), (0, 1));
    }
    // The next update goes into the same slot and works.
    board.update(0, 3).unwrap();
    assert_eq!(board.start(), (1, 3));
}

/// A bit that flips in the image that runs: the loader goes back to the other one.
#[test]
fn a_flipped_bit_is_seen() {
    let board = Board::new(4);
    board.update(0, 2).unwrap();
    assert!(slot::confirm(&mut board.slot(1)));
    board.0.borrow_mut().bytes[STARTS[2] + 77] ^= 4;
    assert_eq!(board.start(), (0, 1));
}

#[test]
fn what_does_not_fit_or_is_not_signed_erases_nothing() {
    let good = file(2, 1);
    let other_slot = file(2, 0);
    let changed = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    let stranger = Place { key: Some(public(&[8; 32])), ..place(1, 1) };
    for (file, place, refused) in [
        (&other_slot, place(1, 1), Refused::Unfit),
        (&changed(0), place(1, 1), Refused::Unfit),
        (&changed(6), place(1, 1), Refused::Unfit),
        (&changed(17), place(1, 1), Refused::Unsigned),
        (&changed(48), place(1, 1), Refused::Unsigned),
        (&changed(120), place(1, 1), Refused::Unsigned),
        (&good, stranger, Refused::Unsigned),
    ] {
        let board = Board::new(5);
        board.power(Some(0));
        let (mut receiver, mut flash) = (Receiver::default(), board.slot(1));
        receiver.take(&mut flash, &place, 0, &file[..96]).unwrap();
        assert_eq!(receiver.take(&mut flash, &place, 96, &file[96..BYTES]), Err(refused));
        assert_eq!(receiver.erase(&mut flash, 2), Err(Refused::OutOfOrder));
    }
}

/// A content that is not what was signed gets no seal, however often its last piece comes; pieces and erases out of order are refused, and repeated ones taken.
#[test]
fn a_changed_content_is_not_sealed_and_order_is_kept() {
    let board = Board::new(6);
    let (mut receiver, mut flash, place) = (Receiver::default(), board.slot(1), place(1, 1));
    let mut file = file(2, 1);
    *file.last_mut().unwrap() ^= 1;
    assert_eq!(receiver.take(&mut flash, &place, 96, &file[96..BYTES]), Err(Refused::OutOfOrder));
    for _ in 0..2 {
        assert_eq!(receiver.take(&mut flash, &place, 0, &file[..96]), Ok(false));
    }
    assert_eq!(receiver.take(&mut flash, &place, 96, &file[96..BYTES]), Ok(false));
    assert_eq!(receiver.take(&mut flash, &place, BYTES as u32, &file[BYTES..BYTES + 96]), Err(Refused::OutOfOrder));
    assert_eq!(receiver.erase(&mut flash, 0), Err(Refused::OutOfOrder));
    for sector in [2, 2, 1, 1, 0, 0] {
        assert_eq!(receiver.erase(&mut flash, sector), Ok(()));
    }
    let mut offset = BYTES;
    let mut last = Ok(false);
    for piece in file[BYTES..].chunks(96) {
        assert_eq!(last, Ok(false));
        last = receiver.take(&mut flash, &place, offset as u32, piece);
        // The same again is answered in the same way.
        assert_eq!(receiver.take(&mut flash, &place, offset as u32, piece), last);
        offset += piece.len();
    }
    assert_eq!(last, Err(Refused::Unsigned));
    // It may come anew.
    assert_eq!(receiver.take(&mut flash, &place, 0, &file[..96]), Ok(false));
    assert_eq!(board.start(), (0, 1));
}

/// What a debug probe brought into slot A is started while nothing else is there.
#[test]
fn an_image_without_a_seal_starts_from_slot_a_alone() {
    for number in 0..2 {
        let memory =
            Memory { bytes: vec![0xFF; ALL], written: vec![false; ALL], power: None, random: 1, operations: 0 };
        let board = Board(Rc::new(RefCell::new(memory)));
        assert_eq!(choose(&mut [board.slot(0), board.slot(1)]), None);
        board.slot(number).write(0, &image(1, number)).unwrap();
        assert_eq!(choose(&mut [board.slot(0), board.slot(1)]), (number == 0).then_some(0));
    }
}

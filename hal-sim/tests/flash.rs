//! The flash memory is as strict as a real one.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use hal_sim::flash::{CAPACITY, ERASE_COST, FlashError, SECTOR, TOTAL};
use hal_sim::{Flash, Scenario, World};

fn flash() -> (World, Flash) {
    let world = World::new(&Scenario::default(), 1);
    let flash = world.flash();
    (world, flash)
}

fn read(flash: &mut Flash, offset: u32, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    flash.read(offset, &mut bytes).expect("within bounds");
    bytes
}

#[test]
fn it_is_erased_at_first_and_keeps_what_is_written() {
    let (world, mut flash) = flash();
    assert_eq!(flash.capacity(), CAPACITY);
    assert!(world.flash_contents().iter().all(|byte| *byte == 0xFF));
    flash.write(8, &[1, 2, 3, 4, 5, 6, 7, 8]).expect("erased");
    assert_eq!(read(&mut flash, 7, 10), [0xFF, 1, 2, 3, 4, 5, 6, 7, 8, 0xFF]);
}

#[test]
fn a_word_can_be_written_once_only() {
    let (_world, mut flash) = flash();
    flash.write(0, &[0xFF; 4]).expect("erased");
    assert_eq!(flash.write(0, &[0; 4]), Err(FlashError::WrittenTwice { offset: 0 }));
    assert_eq!(read(&mut flash, 0, 4), [0xFF; 4]);
    flash.erase(0, SECTOR as u32).expect("aligned");
    assert_eq!(flash.write(0, &[0; 4]), Ok(()));
}

#[test]
fn an_erase_takes_whole_sectors_and_no_others() {
    let (_world, mut flash) = flash();
    flash.write(0, &[0; 4]).expect("erased");
    flash.write(SECTOR as u32, &[0; 4]).expect("erased");
    flash.erase(SECTOR as u32, 2 * SECTOR as u32).expect("aligned");
    assert_eq!(read(&mut flash, 0, 4), [0; 4]);
    assert_eq!(read(&mut flash, SECTOR as u32, 4), [0xFF; 4]);
}

#[test]
fn alignment_and_bounds_are_enforced() {
    let (_world, mut flash) = flash();
    let end = TOTAL as u32;
    assert_eq!(flash.write(2, &[0; 4]), Err(FlashError::NotAligned));
    assert_eq!(flash.write(0, &[0; 3]), Err(FlashError::NotAligned));
    assert_eq!(flash.write(end, &[0; 4]), Err(FlashError::OutOfBounds));
    assert_eq!(flash.write(u32::MAX - 3, &[0; 4]), Err(FlashError::OutOfBounds));
    assert_eq!(flash.erase(0, 100), Err(FlashError::NotAligned));
    assert_eq!(flash.erase(SECTOR as u32, 0), Err(FlashError::OutOfBounds));
    let log = CAPACITY as u32;
    assert_eq!(flash.erase(log, log + SECTOR as u32), Err(FlashError::NotAligned));
    assert_eq!(flash.erase(log, end), Ok(()));
    assert_eq!(flash.erase(0, end + SECTOR as u32), Err(FlashError::OutOfBounds));
    assert_eq!(flash.read(end - 1, &mut [0; 2]), Err(FlashError::OutOfBounds));
}

#[test]
fn a_power_cut_leaves_a_write_half_done_and_the_rest_alone() {
    let (_world, mut flash) = flash();
    flash.cut_power_after(6);
    assert_eq!(flash.write(0, &[0; 12]), Err(FlashError::PowerLost));
    assert_eq!(flash.write(16, &[0; 4]), Err(FlashError::PowerLost));
    assert_eq!(flash.read(0, &mut [0; 1]), Err(FlashError::PowerLost));
    flash.restore_power();
    assert_eq!(read(&mut flash, 0, 12), [0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
    // The word in which it happened is spoilt; the next one was not begun.
    assert_eq!(flash.write(4, &[0; 4]), Err(FlashError::WrittenTwice { offset: 4 }));
    assert_eq!(flash.write(8, &[0; 4]), Ok(()));
    assert_eq!(flash.write(16, &[0; 4]), Ok(()));
}

#[test]
fn a_power_cut_leaves_an_erase_half_done() {
    let (_world, mut flash) = flash();
    flash.write(0, &[0; SECTOR]).expect("erased");
    flash.cut_power_after(ERASE_COST / 2);
    assert_eq!(flash.erase(0, SECTOR as u32), Err(FlashError::PowerLost));
    flash.restore_power();
    let bytes = read(&mut flash, 0, SECTOR);
    assert!(bytes[..SECTOR / 2].iter().all(|byte| *byte == 0xFF));
    assert!(bytes[SECTOR / 2..].iter().all(|byte| *byte == 0));
}

#[test]
fn contents_outlive_the_world() {
    let (world, mut flash) = flash();
    flash.write(4, &[1, 2, 3, 4]).expect("erased");
    let next = World::new(&Scenario::default(), 2).with_flash(&world.flash_contents());
    assert_eq!(read(&mut next.flash(), 4, 4), [1, 2, 3, 4]);
    assert_eq!(next.flash().write(4, &[0; 4]), Err(FlashError::WrittenTwice { offset: 4 }));
    assert_eq!(next.flash().write(8, &[0; 4]), Ok(()));
}

#[test]
fn error_codes_for_transports_are_distinct() {
    let all = [
        FlashError::NotAligned,
        FlashError::OutOfBounds,
        FlashError::WrittenTwice { offset: 0 },
        FlashError::PowerLost,
    ];
    assert_eq!(all.map(FlashError::code), [1, 2, 3, 4]);
}

//! Which slot the loader starts.

use embedded_storage::nor_flash::NorFlash;

use crate::slot::{self, Seal, TRIALS};

/// The number of the slot to start; nothing where none holds an image.
///
/// The latest image that is whole and confirmed, or has a trial left, which is counted before it starts. Where none is, what a
/// debug probe brought into slot A; at last any that is whole.
pub fn choose<F: NorFlash>(slots: &mut [F; 2]) -> Option<usize> {
    let mut whole = [None; 2];
    for (place, slot) in whole.iter_mut().zip(slots.iter_mut()) {
        *place = Seal::read(slot).filter(|seal| seal.is_whole(slot)).map(|seal| seal.sequence);
    }
    let [a, b] = whole;
    let by_age = if a >= b { [0, 1] } else { [1, 0] };
    let sealed = by_age.into_iter().filter(|&number| whole.get(number).is_some_and(Option::is_some));
    let unsealed = (0..1).filter(|_| a.is_none());
    for number in sealed.clone() {
        let Some(slot) = slots.get_mut(number) else { continue };
        if slot::is_confirmed(slot) || (slot::trials(slot) < TRIALS && slot::try_once(slot)) {
            return Some(number);
        }
    }
    let mut brought = unsealed.filter(|&number| slots.get_mut(number).is_some_and(|slot| is_brought(slot)));
    brought.next().or(sealed.clone().next())
}

/// Whether a slot holds an image without a seal: nothing in its trailer, and something at its start.
fn is_brought<F: NorFlash>(flash: &mut F) -> bool {
    let mut vectors = [0; 8];
    slot::is_unsealed(flash) && flash.read(0, &mut vectors).is_ok() && vectors != [0xFF; 8]
}

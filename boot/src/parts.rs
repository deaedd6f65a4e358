//! Flash that is read in parts, each of which a stack has room for.

use core::ops::Range;

use embedded_storage::nor_flash::ReadNorFlash;

const PART: usize = 256;

/// Whether all parts of a place are as `is` wants them, in their order; what follows one that is not is not read.
pub fn all<F: ReadNorFlash>(
    flash: &mut F,
    place: Range<u32>,
    mut is: impl FnMut(&[u8]) -> bool,
) -> Result<bool, F::Error> {
    for at in place.clone().step_by(PART) {
        let mut part = [0; PART];
        let part = part.get_mut(..((place.end - at) as usize).min(PART)).unwrap_or_default();
        flash.read(at, part)?;
        if !is(part) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Tells `told` all parts of a place, in their order.
pub fn each<F: ReadNorFlash>(flash: &mut F, place: Range<u32>, mut told: impl FnMut(&[u8])) -> Result<(), F::Error> {
    all(flash, place, |part| {
        told(part);
        true
    })
    .map(|_| ())
}

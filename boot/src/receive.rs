//! An image on its way into the free slot.

use embedded_storage::nor_flash::NorFlash;
use sha2::{Digest as _, Sha512};

use crate::manifest::{BYTES, Key, Manifest};
use crate::slot::{self, Seal, TRAILER};

/// Flash is read again in parts of this many bytes.
const PART: usize = 96;

/// Why something of an image is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A piece before it is missing, or the slot is not erased.
    OutOfOrder,
    /// It is no image, or one for another board, slot or size.
    Unfit,
    /// It is not signed by the key, or is not what was signed.
    Unsigned,
    /// The flash does not hold what was written.
    NotWritten,
}

/// What an image must fit.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub board: u8,
    pub origin: u32,
    /// Whose images are taken; without one, anybody's.
    pub key: Option<Key>,
    /// Of the image that runs.
    pub sequence: u32,
}

/// The image that comes: its manifest first, then, when all sectors are erased, the image.
pub struct Receiver {
    header: [u8; BYTES],
    /// Bytes that have come, the manifest's among them.
    taken: u32,
    manifest: Option<Manifest>,
    /// Sectors that are still to erase.
    to_erase: u32,
    hash: Sha512,
    /// Why the image that came whole has no seal.
    refused: Option<Refused>,
}

impl Default for Receiver {
    fn default() -> Self {
        Self { header: [0; BYTES], taken: 0, manifest: None, to_erase: 0, hash: Sha512::new(), refused: None }
    }
}

impl Receiver {
    /// Takes a piece; whether it was the last, and the image is sealed. One that came before is taken again, unless the whole image was refused, which it is
    /// again; the first begins anew.
    pub fn take<F: NorFlash>(
        &mut self,
        flash: &mut F,
        place: &Place,
        offset: u32,
        bytes: &[u8],
    ) -> Result<bool, Refused> {
        if offset == 0 {
            *self = Self::default();
        }
        let end = offset.saturating_add(bytes.len() as u32);
        if offset < self.taken && end <= self.taken {
            return self.refused.map_or(Ok(false), Err);
        }
        if offset != self.taken || bytes.is_empty() {
            return Err(Refused::OutOfOrder);
        }
        match self.manifest {
            None => self.begin(flash, place, offset, bytes)?,
            Some(manifest) => self.go_on(flash, &manifest, offset, bytes)?,
        }
        self.taken = end;
        match self.manifest {
            Some(manifest) if end == BYTES as u32 + manifest.length => {
                let sealed = self.seal(flash, &manifest, place);
                self.refused = sealed.err();
                sealed.map(|()| true)
            }
            _ => Ok(false),
        }
    }

    /// A piece of the manifest; nothing is erased before it is whole, fits and is signed.
    fn begin<F: NorFlash>(&mut self, flash: &F, place: &Place, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        let (start, end) = (offset as usize, offset as usize + bytes.len());
        self.header.get_mut(start..end).ok_or(Refused::OutOfOrder)?.copy_from_slice(bytes);
        if end < BYTES {
            return Ok(());
        }
        let manifest = Manifest::read(&self.header).ok_or(Refused::Unfit)?;
        let room = (flash.capacity() as u32).saturating_sub(TRAILER);
        if manifest.board != place.board || manifest.origin != place.origin || manifest.length > room {
            return Err(Refused::Unfit);
        }
        if place.key.is_some_and(|key| !Manifest::is_signed(&self.header, &key)) {
            return Err(Refused::Unsigned);
        }
        self.to_erase = (flash.capacity() / F::ERASE_SIZE) as u32;
        self.manifest = Some(manifest);
        Ok(())
    }

    /// Erases a sector: the last one first, so that the former image has no seal any more before anything else of it is gone.
    pub fn erase<F: NorFlash>(&mut self, flash: &mut F, sector: u32) -> Result<(), Refused> {
        if self.manifest.is_none() || self.taken != BYTES as u32 || sector > self.to_erase || sector + 1 < self.to_erase
        {
            return Err(Refused::OutOfOrder);
        }
        if sector + 1 == self.to_erase {
            let start = sector * F::ERASE_SIZE as u32;
            flash.erase(start, start + F::ERASE_SIZE as u32).map_err(|_| Refused::NotWritten)?;
            self.to_erase = sector;
        }
        Ok(())
    }

    fn go_on<F: NorFlash>(
        &mut self,
        flash: &mut F,
        manifest: &Manifest,
        offset: u32,
        bytes: &[u8],
    ) -> Result<(), Refused> {
        let at = offset - BYTES as u32;
        if self.to_erase > 0 || at + bytes.len() as u32 > manifest.length {
            return Err(Refused::OutOfOrder);
        }
        for (part, at) in bytes.chunks(PART).zip((at..).step_by(PART)) {
            let mut read = [0; PART];
            let read = read.get_mut(..part.len()).ok_or(Refused::NotWritten)?;
            flash.write(at, part).map_err(|_| Refused::NotWritten)?;
            flash.read(at, read).map_err(|_| Refused::NotWritten)?;
            if read != part {
                return Err(Refused::NotWritten);
            }
        }
        self.hash.update(bytes);
        Ok(())
    }

    /// The last step: an image that is what was signed gets its seal.
    fn seal<F: NorFlash>(&mut self, flash: &mut F, manifest: &Manifest, place: &Place) -> Result<(), Refused> {
        let hash: [u8; 64] = core::mem::take(&mut self.hash).finalize().into();
        if hash != manifest.hash {
            return Err(Refused::Unsigned);
        }
        let crc = slot::content_crc(flash, manifest.length).ok_or(Refused::NotWritten)?;
        let seal = Seal { sequence: place.sequence.saturating_add(1), length: manifest.length, crc };
        seal.write(flash).then_some(()).ok_or(Refused::NotWritten)
    }
}

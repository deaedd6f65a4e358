//! Settings on their way over the link: encoded, in pieces.

use embedded_storage::nor_flash::NorFlash;
use heapless::Vec;

use super::Settings;
use super::store::{self, MAX_SETTINGS, SaveError, VERSION};
use crate::event::bytes::Piece;
use crate::health::Refusal;

/// Settings that come piece by piece, in order.
#[derive(Clone, Debug, Default)]
pub struct Incoming {
    version: u16,
    /// Room for what comes; `length` bytes of it have come.
    room: Vec<u8, MAX_SETTINGS>,
    length: usize,
}

impl Incoming {
    /// Its room, for whoever reads or writes settings, so that it takes no board's stack; what has come so far is forgotten.
    pub fn scratch(&mut self) -> &mut [u8] {
        self.length = 0;
        self.room()
    }

    fn room(&mut self) -> &mut [u8] {
        let _ = self.room.resize(MAX_SETTINGS, 0);
        &mut self.room
    }

    fn content(&self) -> &[u8] {
        self.room.get(..self.length).unwrap_or_default()
    }

    /// Takes a piece; whether it was the last. One that came before is taken again, and the first begins anew.
    ///
    /// Errors: one before it is missing, or they belong to something that is too long.
    pub fn take(&mut self, piece: &Piece) -> Result<bool, Refusal> {
        let (offset, bytes) = (usize::from(piece.offset), piece.bytes.as_slice());
        if offset > self.length {
            return Err(Refusal::OutOfOrder);
        }
        self.version = piece.version;
        let end = offset + bytes.len();
        let room = self.room().get_mut(offset..end).ok_or(Refusal::SettingsUnreadable)?;
        room.copy_from_slice(bytes);
        self.length = end;
        Ok(end >= piece.length.into())
    }

    /// What has come, decoded to where it stays; where that fails, `settings` may be anything.
    ///
    /// Errors: it is of a version that is not known, or no settings.
    pub fn read(&self, settings: &mut Settings) -> Result<(), Refusal> {
        store::decode(self.version, self.content(), settings).ok_or(Refusal::SettingsUnreadable)
    }

    /// Keeps it in flash as it came.
    pub fn save<F: NorFlash>(&self, flash: &mut F) -> Result<(), SaveError<F::Error>> {
        store::save_encoded(flash, self.version, self.content())
    }
}

/// Gives settings piece by piece.
#[derive(Clone, Debug)]
pub struct Outgoing {
    content: Vec<u8, MAX_SETTINGS>,
    offset: usize,
}

impl Outgoing {
    /// `None`: the settings are longer than any that are valid.
    pub fn new(settings: &Settings) -> Option<Self> {
        let mut content = Vec::new();
        content.resize(MAX_SETTINGS, 0).ok()?;
        let length = postcard::to_slice(settings, &mut content).ok()?.len();
        content.truncate(length);
        Some(Self { content, offset: 0 })
    }
}

impl Iterator for Outgoing {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        let piece = Piece::of(VERSION, &self.content, self.offset)?;
        self.offset += piece.bytes.as_slice().len();
        (!piece.bytes.as_slice().is_empty()).then_some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::store::longest;

    #[test]
    fn the_longest_settings_come_through_also_with_pieces_sent_twice() {
        let settings = longest::settings();
        let mut incoming = Incoming::default();
        let mut complete = false;
        for piece in Outgoing::new(&settings).unwrap() {
            assert!(!complete);
            complete = incoming.take(&piece).unwrap();
            assert_eq!(incoming.take(&piece), Ok(complete));
        }
        assert!(complete);
        let mut read = Settings::default();
        assert_eq!(incoming.read(&mut read), Ok(()));
        assert_eq!(read, settings);
    }

    #[test]
    fn a_missing_piece_and_another_version_are_refused() {
        let pieces: std::vec::Vec<Piece> = Outgoing::new(&longest::settings()).unwrap().collect();
        let mut incoming = Incoming::default();
        assert_eq!(incoming.take(&pieces[1]), Err(Refusal::OutOfOrder));
        incoming.take(&pieces[0]).unwrap();
        assert_eq!(incoming.take(&pieces[2]), Err(Refusal::OutOfOrder));
        for piece in &pieces {
            incoming.take(&Piece { version: VERSION + 1, ..*piece }).unwrap();
        }
        assert_eq!(incoming.read(&mut Settings::default()), Err(Refusal::SettingsUnreadable));
        let endless = Piece { offset: 6100, length: u16::MAX, ..pieces[0] };
        assert_eq!(incoming.take(&endless), Err(Refusal::OutOfOrder));
    }
}

//! A few bytes of something longer, as they go over the link.

use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Most bytes of a piece.
pub const CAPACITY: usize = 96;

/// At most [`CAPACITY`] bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Bytes {
    length: u8,
    bytes: [u8; CAPACITY],
}

impl Bytes {
    pub const fn new() -> Self {
        Self { length: 0, bytes: [0; CAPACITY] }
    }

    /// As many bytes from the start of `bytes` as there is room for.
    pub fn start_of(bytes: &[u8]) -> Self {
        let mut start = Self::new();
        for (place, byte) in start.bytes.iter_mut().zip(bytes) {
            *place = *byte;
            start.length += 1;
        }
        start
    }

    /// Appends all of `more`, or, where there is no room, nothing: then `false`.
    pub fn extend(&mut self, more: &[u8]) -> bool {
        let length = usize::from(self.length);
        let Some(place) = self.bytes.get_mut(length..length + more.len()) else { return false };
        place.copy_from_slice(more);
        // At most CAPACITY.
        self.length = (length + more.len()) as u8;
        true
    }

    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length.into()).unwrap_or_default()
    }
}

impl Default for Bytes {
    fn default() -> Self {
        Self::new()
    }
}

impl core::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.as_slice().fmt(f)
    }
}

impl Serialize for Bytes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self.as_slice())
    }
}

impl<'de> Deserialize<'de> for Bytes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reader;
        impl Visitor<'_> for Reader {
            type Value = Bytes;

            fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "at most {CAPACITY} bytes")
            }

            fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Bytes, E> {
                let mut read = Bytes::new();
                if read.extend(bytes) { Ok(read) } else { Err(E::invalid_length(bytes.len(), &self)) }
            }
        }
        deserializer.deserialize_bytes(Reader)
    }
}

/// A piece of encoded settings, which are longer than a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Piece {
    /// Version of the settings' format.
    pub version: u16,
    /// Bytes of the whole.
    pub length: u16,
    /// Where in it the piece begins.
    pub offset: u16,
    pub bytes: Bytes,
}

impl Piece {
    /// The piece of encoded settings that begins at `offset`; `None` beyond their end.
    pub fn of(version: u16, content: &[u8], offset: usize) -> Option<Self> {
        let bytes = Bytes::start_of(content.get(offset..)?);
        let [length, offset] = [content.len(), offset].map(u16::try_from);
        Some(Self { version, length: length.ok()?, offset: offset.ok()?, bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_is_not_taken_in_part() {
        let mut bytes = Bytes::start_of(&[7; 90]);
        assert!(!bytes.extend(&[8; 7]) && bytes.extend(&[8; 6]) && !bytes.extend(&[9]) && bytes.extend(&[]));
        assert_eq!((bytes.as_slice().len(), bytes.as_slice()[90]), (96, 8));
        assert_eq!(Bytes::start_of(&[1; 200]).as_slice(), [1; 96]);
    }
}

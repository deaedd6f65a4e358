//! What is said and signed of an image.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | magic, `NFIM` |
//! | 4 | 2 | version of the format, 1 |
//! | 6 | 1 | board: its place in the list of the link, from 0 |
//! | 7 | 1 | 0 |
//! | 8 | 4 | origin: the address that it is linked for |
//! | 12 | 4 | bytes of the image, a multiple of 4 |
//! | 16 | 16 | version, a text, padded with zeros |
//! | 32 | 16 | revision of the sources, the same |
//! | 48 | 64 | SHA-512 of the image |
//! | 112 | 64 | Ed25519 signature of all before |
//!
//! Numbers are little-endian. Behind it comes the image; a file of an update is one of these for each slot.

use ed25519_dalek::{Signature, Signer as _, SigningKey, VerifyingKey};

/// Bytes of it, without and with the signature.
pub const SIGNED: usize = 112;
pub const BYTES: usize = SIGNED + 64;

const MAGIC: [u8; 4] = *b"NFIM";
const FORMAT: u16 = 1;

/// A public key.
pub type Key = [u8; 32];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Manifest {
    pub board: u8,
    pub origin: u32,
    pub length: u32,
    pub version: [u8; 16],
    pub revision: [u8; 16],
    pub hash: [u8; 64],
}

impl Manifest {
    fn to_bytes(self) -> [u8; SIGNED] {
        let mut bytes = [0; SIGNED];
        let parts: [&[u8]; 8] = [
            &MAGIC,
            &FORMAT.to_le_bytes(),
            &[self.board, 0],
            &self.origin.to_le_bytes(),
            &self.length.to_le_bytes(),
            &self.version,
            &self.revision,
            &self.hash,
        ];
        bytes.iter_mut().zip(parts.into_iter().flatten()).for_each(|(place, byte)| *place = *byte);
        bytes
    }

    /// With the owner's signature.
    pub fn signed(self, secret: &[u8; 32]) -> [u8; BYTES] {
        let bytes = self.to_bytes();
        let signature = SigningKey::from_bytes(secret).sign(&bytes).to_bytes();
        let mut signed = [0; BYTES];
        signed.iter_mut().zip(bytes.iter().chain(&signature)).for_each(|(place, byte)| *place = *byte);
        signed
    }

    /// What it says; nothing where it is none. The signature is not looked at.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (magic, rest) = bytes.split_first_chunk()?;
        let (format, rest) = rest.split_first_chunk()?;
        let ([board, _], rest) = rest.split_first_chunk()?;
        let (origin, rest) = rest.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let (version, rest) = rest.split_first_chunk()?;
        let (revision, rest) = rest.split_first_chunk()?;
        let hash = rest.first_chunk()?;
        let manifest = Self {
            board: *board,
            origin: u32::from_le_bytes(*origin),
            length: u32::from_le_bytes(*length),
            version: *version,
            revision: *revision,
            hash: *hash,
        };
        let sound = *magic == MAGIC && u16::from_le_bytes(*format) == FORMAT && manifest.length.is_multiple_of(4);
        (sound && manifest.length > 0).then_some(manifest)
    }

    /// Whether the holder of this key has signed it.
    pub fn is_signed(bytes: &[u8; BYTES], key: &Key) -> bool {
        bytes.split_first_chunk::<SIGNED>().is_some_and(|(signed, signature)| is_signed(signed, signature, key))
    }
}

/// Whether the holder of this key has signed a message.
pub fn is_signed(message: &[u8], signature: &[u8], key: &Key) -> bool {
    let key = VerifyingKey::from_bytes(key);
    let signature = Signature::from_slice(signature);
    key.is_ok_and(|key| signature.is_ok_and(|signature| key.verify_strict(message, &signature).is_ok()))
}

/// Signs a message.
pub fn sign(message: &[u8], secret: &[u8; 32]) -> [u8; 64] {
    SigningKey::from_bytes(secret).sign(message).to_bytes()
}

/// The public key of a secret one.
pub fn public(secret: &[u8; 32]) -> Key {
    SigningKey::from_bytes(secret).verifying_key().to_bytes()
}

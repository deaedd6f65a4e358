//! Who may ask for what is dangerous.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// A public key of Ed25519: in text 64 hexadecimal digits. It is no secret.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PublicKey(pub [u8; 32]);

impl PublicKey {
    /// `None`: these are not 64 hexadecimal digits.
    pub fn from_hex(text: &str) -> Option<Self> {
        let mut key = [0; 32];
        let mut digits = text.chars();
        for place in &mut key {
            let (high, low) = (digits.next()?.to_digit(16)?, digits.next()?.to_digit(16)?);
            // Two digits are a byte.
            *place = (16 * high + low) as u8;
        }
        digits.next().is_none().then_some(Self(key))
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Serialize for PublicKey {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() { serializer.collect_str(self) } else { self.0.serialize(serializer) }
    }
}

impl<'de> Deserialize<'de> for PublicKey {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if !deserializer.is_human_readable() {
            return Deserialize::deserialize(deserializer).map(Self);
        }
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = PublicKey;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a public key of 64 hexadecimal digits")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<PublicKey, E> {
                PublicKey::from_hex(text).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
            }
        }
        deserializer.deserialize_str(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

    use super::*;

    #[test]
    fn a_key_by_hand() {
        let text = "00ff10a5000000000000000000000000000000000000000000000000000000e1";
        let key = PublicKey::from_hex(text).unwrap();
        assert_eq!((&key.0[..4], key.0[31]), ([0, 255, 16, 0xA5].as_slice(), 0xE1));
        assert_eq!(key.to_string(), text);
        assert!(PublicKey::from_hex(&text[1..]).is_none() && PublicKey::from_hex(&text.replace('a', "g")).is_none());
    }
}

//! Dangerous requests need an unlocked session, where the settings name a key: whoever asks shows that he has its secret half.
//!
//! The instrument gives a challenge that never comes twice: 16 bytes of this start's own, and its tick. It is signed with Ed25519, together with the chip's own
//! number, and one challenge is good for one try. What is unlocked stays so until the next start, or for ten minutes in which nothing dangerous is requested.
//!
//! Dangerous is what moves the motor, what is stored, an update, and what is provoked. To abort is never dangerous, nor to read.

use north_boot::manifest::is_signed;

use crate::health::Refusal;
use crate::link::Ask;
use crate::sensing::sample::SAMPLES_PER_SECOND;
use crate::sequence::Command;
use crate::settings::access::PublicKey;

/// Bytes of a challenge.
pub const CHALLENGE: usize = 24;
/// What is signed: a word that nothing else begins with which the same key signs, the chip's number, the challenge.
const WORD: &[u8; 16] = b"north session v1";
pub const MESSAGE: usize = WORD.len() + 12 + CHALLENGE;
/// Ten minutes.
const UNLOCKED_TICKS: u64 = 600 * SAMPLES_PER_SECOND as u64;

/// The message to be signed, of an instrument with this number.
pub fn message(serial: [u32; 3], challenge: &[u8; CHALLENGE]) -> [u8; MESSAGE] {
    let mut message = [0; MESSAGE];
    let serial = serial.map(u32::to_le_bytes);
    let bytes = WORD.iter().chain(serial.as_flattened()).chain(challenge);
    message.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
    message
}

/// The session.
#[derive(Clone, Debug, Default)]
pub struct Session {
    key: Option<PublicKey>,
    entropy: [u32; 4],
    challenge: Option<[u8; CHALLENGE]>,
    unlocked_until: u64,
}

impl Session {
    pub fn set_key(&mut self, key: Option<PublicKey>) {
        self.key = key;
    }

    /// What no other start has.
    pub fn set_entropy(&mut self, entropy: [u32; 4]) {
        self.entropy = entropy;
    }

    /// A challenge, in the place of the one before.
    pub fn challenge(&mut self, tick: u64) -> [u8; CHALLENGE] {
        let mut challenge = [0; CHALLENGE];
        let entropy = self.entropy.map(u32::to_le_bytes);
        let bytes = entropy.as_flattened().iter().copied().chain(tick.to_le_bytes());
        challenge.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        self.challenge = Some(challenge);
        challenge
    }

    /// Takes the challenge back signed.
    ///
    /// Errors: there was none, or the key's holder has not signed it.
    pub fn unlock(&mut self, tick: u64, serial: [u32; 3], signature: &[u8]) -> Result<(), Refusal> {
        let challenge = self.challenge.take().ok_or(Refusal::NotUnlocked)?;
        let Some(PublicKey(key)) = &self.key else { return Ok(()) };
        if !is_signed(&message(serial, &challenge), signature, key) {
            return Err(Refusal::NotUnlocked);
        }
        self.unlocked_until = tick + UNLOCKED_TICKS;
        Ok(())
    }

    pub fn lock(&mut self) {
        self.unlocked_until = 0;
    }

    /// Whether a request may be served now; one that is dangerous prolongs the session.
    pub fn admits(&mut self, ask: &Ask, tick: u64) -> bool {
        if self.key.is_none() || !is_dangerous(ask) {
            return true;
        }
        let unlocked = tick < self.unlocked_until;
        if unlocked {
            self.unlocked_until = tick + UNLOCKED_TICKS;
        }
        unlocked
    }
}

fn is_dangerous(ask: &Ask) -> bool {
    match ask {
        Ask::Command(Command::Start | Command::CalibrateAccelerometers)
        | Ask::WriteSettings(_)
        | Ask::Provoke(_)
        | Ask::SelfTest
        | Ask::WriteImage { .. }
        | Ask::EraseImage { .. }
        | Ask::CheckFix { .. } => true,
        Ask::Command(Command::Abort)
        | Ask::Identify
        | Ask::Status
        | Ask::ReadSettings { .. }
        | Ask::Stream(_)
        | Ask::SetClock { .. }
        | Ask::ReadLog { .. }
        | Ask::Challenge
        | Ask::Unlock(_)
        | Ask::Lock => false,
    }
}

#[cfg(test)]
mod tests {
    use north_boot::manifest::{public, sign};

    use super::*;

    const SECRET: [u8; 32] = [7; 32];
    const SERIAL: [u32; 3] = [1, 2, 3];
    const START: Ask = Ask::Command(Command::Start);

    fn locked() -> Session {
        Session { key: Some(PublicKey(public(&SECRET))), entropy: [9; 4], ..Session::default() }
    }

    #[test]
    fn the_keys_holder_unlocks_for_ten_minutes() {
        let mut session = locked();
        assert!(!session.admits(&START, 0) && session.admits(&Ask::Command(Command::Abort), 0));
        assert_eq!(session.unlock(0, SERIAL, &[0; 64]), Err(Refusal::NotUnlocked));
        let challenge = session.challenge(400);
        let signature = sign(&message(SERIAL, &challenge), &SECRET);
        assert_eq!(session.unlock(500, SERIAL, &signature), Ok(()));
        assert!(session.admits(&START, 500) && session.admits(&START, 500 + UNLOCKED_TICKS - 1));
        // That one prolonged it.
        assert!(session.admits(&Ask::SelfTest, 500 + 2 * UNLOCKED_TICKS - 2));
        assert!(!session.admits(&START, 500 + 4 * UNLOCKED_TICKS));
        // What was signed once is good for nothing else.
        assert_eq!(session.unlock(600, SERIAL, &signature), Err(Refusal::NotUnlocked));
        session.challenge(401);
        assert_eq!(session.unlock(600, SERIAL, &signature), Err(Refusal::NotUnlocked));
    }

    #[test]
    fn another_key_another_instrument_and_a_lock_keep_it_locked() {
        let mut session = locked();
        for (serial, secret) in [(SERIAL, [8; 32]), ([1, 2, 4], SECRET)] {
            let challenge = session.challenge(5);
            assert_eq!(
                session.unlock(5, SERIAL, &sign(&message(serial, &challenge), &secret)),
                Err(Refusal::NotUnlocked)
            );
        }
        let challenge = session.challenge(5);
        session.unlock(5, SERIAL, &sign(&message(SERIAL, &challenge), &SECRET)).unwrap();
        session.lock();
        assert!(!session.admits(&START, 6));
    }

    #[test]
    fn without_a_key_nothing_is_locked() {
        let mut session = Session::default();
        assert!(session.admits(&START, 0));
        session.challenge(1);
        assert_eq!(session.unlock(1, SERIAL, &[]), Ok(()));
    }
}

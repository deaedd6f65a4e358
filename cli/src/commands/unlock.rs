//! `north unlock`: a session with a board that has a key.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use north_boot::manifest::{Key, sign};
use north_finder::event::Event;
use north_finder::event::bytes::Bytes;
use north_finder::instrument::session::message;
use north_finder::link::Ask;

use super::update::read_key;
use crate::failure::Failure;
use crate::output;
use crate::port::{Port, PortError, PortOption};

/// How often a new challenge is asked for: a signature is good for one try, and the answer to it may be lost.
const ROUNDS: u32 = 3;

/// Unlock a board whose settings name a key (`link.key`), or lock it again
///
/// Without it such a board starts no fix and no calibration, stores no settings and takes no update. It stays unlocked until its next start, or for ten minutes
/// in which nothing of that is asked of it.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north update key owner.key                       # once; prints the public key
  north settings set link.key=<public key>
  north unlock --key owner.key && north monitor --start
  north unlock --lock")]
pub struct Unlock {
    /// The secret key
    #[arg(long, value_name = "FILE", required_unless_present = "lock")]
    key: Option<PathBuf>,
    /// Lock it
    #[arg(long, conflicts_with = "key")]
    lock: bool,
    #[command(flatten)]
    port: PortOption,
}

impl Unlock {
    pub fn run(self) -> Result<(), Failure> {
        let secret = self.key.as_deref().map(read_key).transpose()?;
        let mut port = self.port.open()?;
        let Some(secret) = secret else {
            port.ask(Ask::Lock, &mut |_| ())?;
            writeln!(output::people(), "{}: locked", port.name())?;
            return Ok(());
        };
        unlock(&mut port, &secret)?;
        writeln!(output::people(), "{}: unlocked", port.name())?;
        Ok(())
    }
}

/// Signs challenges until one is answered.
fn unlock(port: &mut Port, secret: &Key) -> Result<(), PortError> {
    let serial = port.identity()?.serial;
    for _ in 1..ROUNDS {
        match sign_challenge(port, serial, secret) {
            Err(PortError::NoAnswer { .. }) => {}
            answered => return answered,
        }
    }
    sign_challenge(port, serial, secret)
}

/// Asks for a challenge and sends it back signed.
fn sign_challenge(port: &mut Port, serial: [u32; 3], secret: &Key) -> Result<(), PortError> {
    let mut challenge = None;
    port.ask(Ask::Challenge, &mut |report| {
        if let Event::Challenge { bytes } = report.event {
            challenge = Some(bytes);
        }
    })?;
    let challenge = challenge.ok_or_else(|| PortError::NoAnswer { port: port.name().into(), other_version: false })?;
    let signature = sign(&message(serial, &challenge), secret);
    port.ask_once(Ask::Unlock(Bytes::start_of(&signature)), &mut |_| ())
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::thread;
    use std::time::Duration;

    use north_boot::manifest::{is_signed, public};
    use north_finder::event::Report;
    use north_finder::event::identity::{Board, Identity};
    use north_finder::instrument::session::CHALLENGE;
    use north_finder::link::{Request, RequestDecoder, encode_report};
    use serialport::{SerialPort, TTYPort};

    use super::*;
    use crate::commands::board::connected;

    const SECRET: Key = [7; 32];
    const SERIAL: [u32; 3] = [1, 2, 3];

    /// A board that hears two signatures, and whose answer to the first is lost: whether each is of a challenge that was good for it.
    fn serve(line: &mut TTYPort) -> [bool; 2] {
        line.set_timeout(Duration::from_secs(10)).unwrap();
        let mut requests = RequestDecoder::new();
        let (mut given, mut challenge) = (0, None);
        let mut signed = Vec::new();
        loop {
            let mut byte = [0];
            line.read_exact(&mut byte).unwrap();
            let Some(Ok(Request { number, ask })) = requests.feed(byte[0]) else { continue };
            let told = match ask {
                Ask::Identify => Some(Event::Identity(Identity::new(Board::Stm32f405, 1, SERIAL))),
                Ask::Challenge => {
                    given += 1;
                    challenge = Some([given; CHALLENGE]);
                    challenge.map(|bytes| Event::Challenge { bytes })
                }
                Ask::Unlock(signature) => {
                    let challenge = challenge.take();
                    signed.push(challenge.is_some_and(|challenge| {
                        is_signed(&message(SERIAL, &challenge), signature.as_slice(), &public(&SECRET))
                    }));
                    if signed.len() == 1 {
                        continue;
                    }
                    None
                }
                _ => None,
            };
            for event in told.into_iter().chain([Event::Answer { number, refusal: None }]) {
                line.write_all(&encode_report(&Report { t_s: 0.0, event }).unwrap()).unwrap();
            }
            if let [first, second] = signed[..] {
                return [first, second];
            }
        }
    }

    /// A signature whose answer is lost is not sent again, for it is good for one try: another challenge is signed.
    #[test]
    fn a_lost_answer_to_a_signature_begins_another_round() {
        let (mut line, mut port) = connected().unwrap();
        let signed = thread::scope(|scope| {
            let board = scope.spawn(|| serve(&mut line));
            unlock(&mut port, &SECRET).unwrap();
            board.join().unwrap()
        });
        assert_eq!(signed, [true, true]);
    }
}

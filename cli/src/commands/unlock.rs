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

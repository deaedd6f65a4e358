//! `north update`: an image onto a board; keys, and the file that is signed with them.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use north_boot::manifest::{BYTES, Key, Manifest, public};
use north_boot::{SECTOR_BYTES, SLOT_BYTES, SLOTS};
use north_finder::event::bytes::{Bytes, CAPACITY};
use north_finder::event::identity::Board;
use north_finder::link::Ask;
use sha2::{Digest as _, Sha512};

use crate::failure::Failure;
use crate::file_error::FileError;
use crate::output;
use crate::port::{Port, PortOption};
use crate::progress;

/// Bytes of a secret key.
const SECRET: usize = 32;

/// Bring another firmware to a board, or make the file and the keys for that
///
/// The file holds a signed image for each slot. The one that fits the free slot is sent, checked by the board and tried; where it does not start, or does not
/// run for ten seconds, the board goes back to the image before. Settings stay. A power cut at any time does no harm: send the file again.
#[derive(Args, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:
  north update north-f405.update --port /dev/ttyUSB0
  north update key owner.key
  north update sign --key owner.key --out north-f405.update slot-a.bin slot-b.bin"
)]
pub struct Update {
    #[command(subcommand)]
    make: Option<Make>,
    /// The file of the update
    #[arg(value_name = "FILE", required = true)]
    file: Option<PathBuf>,
    #[command(flatten)]
    port: PortOption,
}

#[derive(Debug, Subcommand)]
enum Make {
    /// Make a secret key, and print the public one, which the firmware is built with (NORTH_KEY)
    Key {
        /// The new file of the secret key
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
    /// Sign the images of both slots, and put them into a file for updates
    Sign {
        /// The secret key
        #[arg(long, value_name = "FILE")]
        key: PathBuf,
        /// The new file
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Revision of the sources
        #[arg(long, value_name = "TEXT", default_value = "")]
        revision: String,
        /// The image of slot A, as it is in flash
        #[arg(value_name = "SLOT-A")]
        a: PathBuf,
        /// The image of slot B
        #[arg(value_name = "SLOT-B")]
        b: PathBuf,
    },
}

impl Update {
    pub fn run(self) -> Result<(), Failure> {
        match (self.make, self.file) {
            (Some(Make::Key { file }), _) => make_key(&file),
            (Some(Make::Sign { key, out, revision, a, b }), _) => sign(&key, &out, &revision, [&a, &b]),
            (None, Some(file)) => bring(&file, &mut self.port.open()?),
            (None, None) => Err(Failure::Usage("which file?".into())),
        }
    }
}

fn make_key(path: &Path) -> Result<(), Failure> {
    let mut secret = [0; SECRET];
    getrandom::fill(&mut secret)
        .map_err(|error| Failure::Refused(format!("the system gives no random numbers: {error}")))?;
    output::write(path, hex(&secret) + "\n").map_err(|error| FileError::whole(path, error))?;
    #[cfg(unix)]
    fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o600))?;
    writeln!(output::people(), "{}", hex(&public(&secret)))?;
    Ok(())
}

fn sign(key: &Path, out: &Path, revision: &str, images: [&Path; 2]) -> Result<(), Failure> {
    let secret = read_key(key)?;
    let mut file = Vec::new();
    for (path, origin) in images.into_iter().zip(SLOTS) {
        let mut image = read(path)?;
        image.resize(image.len().next_multiple_of(4), 0xFF);
        check(&image, origin).map_err(|why| Failure::Refused(format!("{}: {why}", path.display())))?;
        let manifest = Manifest {
            board: Board::Stm32f405 as u8,
            origin,
            length: image.len() as u32,
            version: text(env!("CARGO_PKG_VERSION")),
            revision: text(revision),
            hash: Sha512::digest(&image).into(),
        };
        file.extend(manifest.signed(&secret));
        file.extend(image);
    }
    Ok(output::write(out, file).map_err(|error| FileError::whole(out, error))?)
}

/// Whether an image is linked for this address: its reset vector says so.
fn check(image: &[u8], origin: u32) -> Result<(), String> {
    let reset = image.get(4..8).and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes);
    match reset {
        Some(reset) if (origin..origin + SLOT_BYTES).contains(&reset) => Ok(()),
        Some(reset) => Err(format!("its start is at {reset:#010x}, and the slot begins at {origin:#010x}")),
        None => Err("it is too short for an image".into()),
    }
}

/// Sends the image of a file that fits the board's free slot.
fn bring(path: &Path, port: &mut Port) -> Result<(), Failure> {
    let file = read(path)?;
    let identity = port.identity()?;
    let refused = |why: &str| Failure::Refused(format!("{}: {why}", path.display()));
    if identity.free_slot == 0 {
        return Err(Failure::Refused(format!(
            "{}: the board has no free slot: its firmware was not started by the loader",
            port.name()
        )));
    }
    let (mut rest, mut fitting) = (file.as_slice(), None);
    while !rest.is_empty() {
        let manifest = Manifest::read(rest).ok_or_else(|| refused("this is no file of an update"))?;
        let length = BYTES + manifest.length as usize;
        let (image, after) = rest.split_at_checked(length).ok_or_else(|| refused("it ends within an image"))?;
        if manifest.origin == identity.free_slot {
            fitting = Some(image);
        }
        rest = after;
    }
    let image = fitting.ok_or_else(|| refused("it has no image for the free slot"))?;
    send(port, image)?;
    writeln!(
        output::people(),
        "{}: the image is there and signed; the board starts anew and tries it for ten seconds",
        port.name()
    )?;
    Ok(())
}

fn send(port: &mut Port, image: &[u8]) -> Result<(), Failure> {
    let (manifest, content) = image.split_at(BYTES);
    let bar = progress::bar(image.len() as u64, "bytes");
    let mut offset = 0;
    let mut pieces = |port: &mut Port, bytes: &[u8]| -> Result<(), Failure> {
        for piece in bytes.chunks(CAPACITY) {
            port.ask(Ask::WriteImage { offset, bytes: Bytes::start_of(piece) }, &mut |_| ())?;
            offset += piece.len() as u32;
            bar.set_position(offset.into());
        }
        Ok(())
    };
    pieces(port, manifest)?;
    for sector in (0..(SLOT_BYTES / SECTOR_BYTES) as u8).rev() {
        port.ask(Ask::EraseImage { sector }, &mut |_| ())?;
    }
    pieces(port, content)?;
    bar.finish_and_clear();
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    Ok(fs::read(path).map_err(|error| FileError::whole(path, error))?)
}

pub(super) fn read_key(path: &Path) -> Result<Key, Failure> {
    let text = String::from_utf8_lossy(&read(path)?).trim().to_owned();
    let digits: Option<Vec<u8>> = (text.as_bytes().chunks(2))
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok().filter(|pair| pair.len() == 2)?, 16).ok())
        .collect();
    let key = digits.and_then(|digits| digits.try_into().ok());
    key.ok_or_else(|| Failure::Refused(format!("{}: a key is {} hexadecimal digits", path.display(), 2 * SECRET)))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// As much of the beginning as there is room for, padded with zeros.
fn text(text: &str) -> [u8; 16] {
    let mut padded = [0; 16];
    padded.iter_mut().zip(text.bytes()).for_each(|(place, byte)| *place = byte);
    padded
}

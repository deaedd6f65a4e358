//! What is flashed: the firmware, and the record of its settings.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use north_finder::event::service::flash::LOG_SECTORS;
use north_finder::event::service::log::FixLog;
use north_finder::event::service::record::Logged;
use north_finder::settings::{Settings, store};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds the firmware for the STM32F405 from the sources beside this crate's; gives where it is. Quick when nothing changed.
pub fn build() -> Result<PathBuf, String> {
    build_into("f405", &["--bin", "firmware"], None).map(|folder| folder.join("firmware"))
}

/// Builds the loader, and the firmware for the first slot of an update.
pub fn build_slot() -> Result<[PathBuf; 2], String> {
    let loader = build_into("loader", &["--package", "north-boot", "--bin", "loader"], None)?;
    let slot = build_into("slot-a", &["--bin", "firmware"], Some("a"))?;
    Ok([loader.join("loader"), slot.join("firmware")])
}

/// Gives the folder with what was built.
fn build_into(folder: &str, what: &[&str], slot: Option<&str>) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("there are no sources beside this crate")?;
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |directory| root.join(directory));
    let directory = target.join(folder);
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root).args(["build", "--quiet", "--profile", "firmware"]).args(what);
    if let Some(slot) = slot {
        cargo.env("NORTH_SLOT", slot);
    }
    cargo.args(["--target", TARGET, "--target-dir"]).arg(&directory);
    let status = cargo.status().map_err(|error| format!("cargo cannot be started: {error}"))?;
    if !status.success() {
        return Err(format!("the firmware cannot be built (is the target there? rustup target add {TARGET})"));
    }
    Ok(directory.join(TARGET).join("firmware"))
}

/// What the flash's sectors for settings hold after these were stored.
pub fn stored(settings: &Settings) -> Result<Vec<u8>, String> {
    let mut sectors = Sectors::default();
    store::save(&mut sectors, settings).map_err(|error| format!("the settings cannot be stored: {error:?}"))?;
    Ok(sectors.0)
}

/// What the flash's sectors of the log hold after some fixes, of a program of this identity and of no error model.
pub fn logged(fixes: impl Iterator<Item = Logged>, program: u32) -> Result<[Vec<u8>; 2], String> {
    let [first, second] = LOG_SECTORS.map(|bytes| bytes as usize);
    let mut sectors = Sectors(vec![0xFF; first + second]);
    let mut log = FixLog::default();
    for fix in fixes {
        log.push(&mut sectors, &fix, program, 0).map_err(|error| format!("a fix cannot be logged: {error:?}"))?;
    }
    let second = sectors.0.split_off(first);
    Ok([sectors.0, second])
}

/// The flash's sectors for settings, or of the log, away from the chip.
#[derive(Clone, Debug, PartialEq)]
pub struct Sectors(pub Vec<u8>);

impl Default for Sectors {
    fn default() -> Self {
        Self(vec![0xFF; Self::SECTOR * 2])
    }
}

impl Sectors {
    const SECTOR: usize = 16 << 10;
}

impl ErrorType for Sectors {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let from = offset as usize;
        let place = self.0.get(from..from + bytes.len()).ok_or(NorFlashErrorKind::OutOfBounds)?;
        bytes.copy_from_slice(place);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = Self::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let place = self.0.get_mut(from as usize..to as usize).ok_or(NorFlashErrorKind::OutOfBounds)?;
        place.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let from = offset as usize;
        let place = self.0.get_mut(from..from + bytes.len()).ok_or(NorFlashErrorKind::OutOfBounds)?;
        place.iter_mut().zip(bytes).for_each(|(place, byte)| *place &= byte);
        Ok(())
    }
}

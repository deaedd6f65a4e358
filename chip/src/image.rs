//! What is flashed: the firmware, and the record of its settings.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use embedded_storage::nor_flash::ReadNorFlash as _;
use hal_sim::{Scenario, World};
use north_finder::settings::{Settings, store};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds the firmware for the STM32F405 from the sources beside this crate's; gives where it is. Quick when nothing changed.
pub fn build() -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("there are no sources beside this crate")?;
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |directory| root.join(directory));
    let directory = target.join("f405");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root).args(["build", "--quiet", "--profile", "firmware", "--bin", "firmware"]);
    cargo.args(["--target", TARGET, "--target-dir"]).arg(&directory);
    let status = cargo.status().map_err(|error| format!("cargo cannot be started: {error}"))?;
    if !status.success() {
        return Err(format!("the firmware cannot be built (is the target there? rustup target add {TARGET})"));
    }
    Ok(directory.join(TARGET).join("firmware").join("firmware"))
}

/// What the first of the flash's sectors for settings holds after these were stored.
pub fn stored(settings: &Settings) -> Result<Vec<u8>, String> {
    let mut flash = World::new(&Scenario::default(), 0).flash();
    store::save(&mut flash, settings).map_err(|error| format!("the settings cannot be stored: {error:?}"))?;
    let mut record = vec![0; flash.capacity() / 2];
    flash.read(0, &mut record).map_err(|error| error.to_string())?;
    Ok(record)
}

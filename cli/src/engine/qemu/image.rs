//! The firmware image for QEMU: built, found, measured.

use std::env;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use object::{Object, ObjectSection};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error("the firmware's sources are not at {0}: run north where it was built, or name an image")]
    NoSources(PathBuf),
    #[error("cargo cannot be started to build the firmware: {0}")]
    NoCargo(io::Error),
    #[error("the firmware cannot be built (is the target there? rustup target add {TARGET})\n{0}")]
    NotBuilt(String),
    #[error("{path}: {error}")]
    NotReadable { path: PathBuf, error: String },
}

/// Builds the image from the sources that this program was built from; gives its path. Quick when nothing changed.
///
/// It has its own target directory, so that it can be built while cargo runs the caller.
pub fn build() -> Result<PathBuf, ImageError> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = root.canonicalize().map_err(|_| ImageError::NoSources(root.clone()))?;
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("qemu");
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .current_dir(&root)
        .args(["build", "--profile", "firmware", "--no-default-features", "--features", "mps2", "--bin", "firmware"])
        .args(["--target", TARGET, "--target-dir"])
        .arg(&target)
        .stdin(Stdio::null());
    let watched = io::stderr().is_terminal();
    if watched {
        command.stderr(Stdio::inherit());
    }
    let output = command.output().map_err(ImageError::NoCargo)?;
    if !output.status.success() {
        return Err(ImageError::NotBuilt(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    Ok(target.join(TARGET).join("firmware").join("firmware"))
}

/// What the image takes of the microcontroller, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Program and constants, in flash.
    pub flash: u64,
    /// Variables, in RAM, without the stack.
    pub ram: u64,
}

/// Size of an image, by its sections.
pub fn size(image: &Path) -> Result<Size, ImageError> {
    let not_readable = |error: String| ImageError::NotReadable { path: image.to_owned(), error };
    let bytes = std::fs::read(image).map_err(|error| not_readable(error.to_string()))?;
    let file = object::File::parse(bytes.as_slice()).map_err(|error| not_readable(error.to_string()))?;
    let size = |names: &[&str]| {
        file.sections()
            .filter(|section| section.name().is_ok_and(|name| names.contains(&name)))
            .map(|section| section.size())
            .sum()
    };
    Ok(Size { flash: size(&[".vector_table", ".text", ".rodata", ".data"]), ram: size(&[".data", ".bss", ".uninit"]) })
}

//! The firmware images: built, found, measured.

use std::env;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::NamedTempFile;

const TARGET: &str = "thumbv7em-none-eabihf";

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error("the firmware's sources are not at {0}: run north where it was built, or name an image")]
    NoSources(PathBuf),
    #[error("the firmware's image cannot be put into a temporary file: {0}")]
    NotLent(io::Error),
    #[error("cargo cannot be started to build the firmware: {0}")]
    NoCargo(io::Error),
    #[error("the firmware cannot be built (is the target there? rustup target add {TARGET})\n{0}")]
    NotBuilt(String),
}

/// The board that an image is for: its feature, and the directory below the target directory where it is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// QEMU's board with the simulated world around it.
    Mps2,
    /// The real one.
    F405,
}

/// The emulated board's image that this program carries, if it was released with one.
#[cfg(carries_firmware)]
const CARRIED: Option<&[u8]> = Some(include_bytes!(concat!(env!("OUT_DIR"), "/firmware")));
#[cfg(not(carries_firmware))]
const CARRIED: Option<&[u8]> = None;

/// An image in a file, which goes with this where it is only lent.
#[derive(Debug)]
pub struct Image {
    path: PathBuf,
    _lent: Option<NamedTempFile>,
}

impl Image {
    /// The emulated board's image: that which this program carries, else the one that is built from its sources.
    pub fn emulated() -> Result<Self, ImageError> {
        let Some(image) = CARRIED else { return Ok(Self { path: build(Board::Mps2)?, _lent: None }) };
        let lend = || {
            let mut file = NamedTempFile::with_prefix("north-firmware-")?;
            file.write_all(image)?;
            file.flush()?;
            Ok(file)
        };
        let file = lend().map_err(ImageError::NotLent)?;
        Ok(Self { path: file.path().to_owned(), _lent: Some(file) })
    }

    /// The image in a file of somebody's own.
    pub fn named(path: &Path) -> Self {
        Self { path: path.to_owned(), _lent: None }
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Builds the image from the sources that this program was built from; gives its path. Quick when nothing changed.
///
/// It has its own target directory, so that it can be built while cargo runs the caller.
pub fn build(board: Board) -> Result<PathBuf, ImageError> {
    // As the Makefile asks for them: what it has built is not built again.
    let (features, directory): (&[&str], &str) = match board {
        Board::Mps2 => (&["--no-default-features", "--features", "mps2"], "qemu"),
        Board::F405 => (&[], "f405"),
    };
    build_program("firmware", features, directory)
}

/// Builds the program that measures single steps on the emulated board.
pub fn build_kernels() -> Result<PathBuf, ImageError> {
    build_program("kernels", &["--package", "kernels"], "qemu")
}

fn build_program(program: &str, options: &[&str], directory: &str) -> Result<PathBuf, ImageError> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = root.canonicalize().map_err(|_| ImageError::NoSources(root.clone()))?;
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join(directory);
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .current_dir(&root)
        .args(["build", "--profile", "firmware", "--bin", program])
        .args(options)
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
    Ok(target.join(TARGET).join("firmware").join(program))
}

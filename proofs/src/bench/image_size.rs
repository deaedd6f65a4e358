//! Size of the firmware image.

use std::path::Path;

use north::failure::Failure;
use object::{Object, ObjectSection};

/// What the image takes of the microcontroller, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Program and constants, in flash.
    pub flash: u64,
    /// Variables, in RAM, without the stack.
    pub ram: u64,
}

/// Size of an image, by its sections.
pub fn size(image: &Path) -> Result<Size, Failure> {
    let not_readable = |error: String| Failure::Refused(format!("{}: {error}", image.display()));
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

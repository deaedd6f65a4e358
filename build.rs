//! Tells the linker what the boards need: scripts, and where their memories are.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=src/board/mps2/device.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let qemu = env::var_os("CARGO_FEATURE_MPS2").is_some();
    println!("cargo:rustc-link-search={root}");
    if qemu {
        // The F405's device.x comes with its register crate.
        println!("cargo:rustc-link-search={root}/src/board/mps2");
    }
    // The STM32F405 has the settings between the vectors and the program; the other board its vectors alone.
    let [flash, program] = if qemu { [0x0000_0000, 0x400] } else { [0x0800_0000, 0x1_0000] };
    println!("cargo:rustc-link-arg-bins=--defsym=_flash_origin={flash:#010x}");
    println!("cargo:rustc-link-arg-bins=--defsym=_program_offset={program:#x}");
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

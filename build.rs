//! Tells the linker what the boards need: scripts, and where the flash is.

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
    let flash_origin = if qemu { "0x00000000" } else { "0x08000000" };
    for argument in [&format!("--defsym=_flash_origin={flash_origin}"), "--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

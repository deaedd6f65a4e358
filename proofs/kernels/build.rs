//! Tells the linker where the emulated board's scripts and memories are: those of the firmware.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR") + "/../..";
    for file in ["memory.x", "src/board/mps2/device.x"] {
        println!("cargo:rerun-if-changed={root}/{file}");
    }
    println!("cargo:rustc-link-search={root}");
    println!("cargo:rustc-link-search={root}/src/board/mps2");
    for argument in [
        "--defsym=_flash_origin=0",
        "--defsym=_program_offset=0x400",
        // The steps stand on the frames of what measures them: 64 KiB.
        "--defsym=_stack_length=0x10000",
        "--defsym=_ram_length=0x15F00",
        "--nmagic",
        "-Tlink.x",
        "-Tdefmt.x",
    ] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

//! Tells the linker where the loader is.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=loader.x");
    println!("cargo:rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
        // For the loader alone, in the firmware's memory: its vectors at the flash's start, and the program behind them.
        for argument in [
            &format!("-L{root}/.."),
            "--defsym=_flash_origin=0x08000000",
            "--defsym=_program_offset=0x400",
            "--defsym=_stack_length=0xE000",
            "--defsym=_ram_length=0x11F00",
            "--nmagic",
            "-Tlink.x",
            &format!("-T{root}/loader.x"),
        ] {
            println!("cargo:rustc-link-arg-bins={argument}");
        }
    }
}

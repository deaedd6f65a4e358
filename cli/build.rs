//! Puts the emulated board's image into the command where `NORTH_FIRMWARE` names one: a command that is released needs neither sources nor cargo.

use std::path::Path;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=NORTH_FIRMWARE");
    println!("cargo:rustc-check-cfg=cfg(carries_firmware)");
    let Ok(image) = env::var("NORTH_FIRMWARE") else { return };
    println!("cargo:rerun-if-changed={image}");
    let carried = env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    if let Err(error) = fs::copy(&image, Path::new(&carried).join("firmware")) {
        panic!("NORTH_FIRMWARE={image}: {error}");
    }
    println!("cargo:rustc-cfg=carries_firmware");
}

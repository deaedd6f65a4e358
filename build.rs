//! Tells the linker what the boards need: scripts, and where their memories are.

use std::env;
use std::process::Command;

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
    // An image that a loader starts is all in its slot. Without a loader the STM32F405 has settings and log between the vectors and the program; the
    // other board its vectors alone.
    println!("cargo:rerun-if-env-changed=NORTH_SLOT");
    println!("cargo:rerun-if-env-changed=NORTH_KEY");
    let is_key = |key: &String| key.len() == 64 && key.bytes().all(|digit| digit.is_ascii_hexdigit());
    assert!(env::var("NORTH_KEY").iter().all(is_key), "NORTH_KEY is not 64 hexadecimal digits");
    let slot = env::var("NORTH_SLOT");
    let [flash, program] = match (qemu, slot.as_deref()) {
        (true, _) => [0x0000_0000, 0x400],
        (false, Ok("a")) => [0x0802_0000, 0x400],
        (false, Ok("b")) => [0x0808_0000, 0x400],
        (false, Ok(other)) => panic!("NORTH_SLOT is {other:?}: a or b"),
        (false, Err(_)) => [0x0800_0000, 0x2_0000],
    };
    // The emulated board has memory for what it exchanges with the simulated instrument, beside what an STM32F405 has.
    let ram = if qemu { 0x1_5F00 } else { 0x1_1F00 };
    println!("cargo:rustc-link-arg-bins=--defsym=_stack_length=0xE000");
    println!("cargo:rustc-link-arg-bins=--defsym=_ram_length={ram:#x}");
    println!("cargo:rustc-env=NORTH_REVISION={}", revision(&root));
    println!("cargo:rustc-link-arg-bins=--defsym=_flash_origin={flash:#010x}");
    println!("cargo:rustc-link-arg-bins=--defsym=_program_offset={program:#x}");
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// What git calls these sources, with a `+` where they were changed; empty where there is no git.
fn revision(root: &str) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .args(["-C", root])
            .args(arguments)
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    for path in ["HEAD", "logs/HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--path-format=absolute", "--git-path", path]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|changes| !changes.is_empty());
    git(&["rev-parse", "--short=10", "HEAD"]).map_or_else(String::new, |hash| if changed { hash + "+" } else { hash })
}

//! The image costs no more than the checked-in baseline allows: instructions, flash, RAM and stack.

use std::process::Command;

#[test]
fn the_image_costs_no_more_than_its_baseline_allows() {
    let baseline = concat!(env!("CARGO_MANIFEST_DIR"), "/bench-baseline.toml");
    let output =
        Command::new(env!("CARGO_BIN_EXE_north")).args(["bench", "cost", "--check", baseline]).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr));
}

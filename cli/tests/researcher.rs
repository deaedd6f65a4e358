//! The Python of docs/researcher.md, run as it stands there.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::{env, fs};

/// Four dwells of 30 s at 34.75° N, the mark at 40°: 12.3585 °/h · cos 40° = 9.467 forward, · sin 40° = 7.944 left of it. The
/// noise cancels in pairs.
fn run(positions: usize) -> String {
    let mut text = String::from("t_s,index_deg,fog_arcsec\n");
    for second in 0..30 * positions {
        let position = second / 30;
        let noise = if second % 2 == 0 { 0.05 } else { -0.05 };
        let rate = [9.467_161, 7.943_890, -9.467_161, -7.943_890][position] + noise;
        writeln!(text, "{},{},{rate}", second + 1, 90 * position).unwrap();
    }
    text
}

#[test]
fn the_snippet_prints_azimuths_and_refusals() {
    if Command::new("python3").arg("--version").stdout(Stdio::null()).status().is_err() {
        println!("skipped: no python3");
        return;
    }
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/researcher.md")).unwrap();
    let code = page.split_once("```python\n").and_then(|(_, rest)| rest.split_once("```")).unwrap().0;
    let folder = tempfile::tempdir().unwrap();
    let campaign = folder.path().join("campaign");
    fs::create_dir(&campaign).unwrap();
    fs::write(campaign.join("good.csv"), run(4)).unwrap();
    fs::write(campaign.join("short.csv"), run(1)).unwrap();
    let manifest = "format = 1\nlatitude_deg = 34.75\n[[run]]\nfile = \"good.csv\"\n[[run]]\nfile = \"short.csv\"\n";
    fs::write(campaign.join("campaign.toml"), manifest).unwrap();
    let beside = Path::new(env!("CARGO_BIN_EXE_north")).parent().unwrap();
    let path = env::join_paths(
        [beside.to_owned()].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())),
    );
    let output = Command::new("python3")
        .args(["-c", code])
        .env("PATH", path.unwrap())
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{error}");
    let azimuth = said.strip_prefix("good.csv 120 rows, 120 s: ").and_then(|rest| rest.split_once(" ± ")).unwrap().0;
    // What the alternating noise leaves of itself: 0.0025°.
    assert!((azimuth.parse::<f64>().unwrap() - 40.0).abs() < 5e-3, "{said}");
    assert!(said.contains("\nshort.csv refused: "), "{said}");
}

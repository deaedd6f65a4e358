//! The loop with the firmware's state machine, in process: an undeclared effect is found and taken out.

use std::process::Command;

fn close_loop(effect: &str) -> serde_json::Value {
    let output = Command::new(env!("CARGO_BIN_EXE_north"))
        .args([
            "close-loop",
            "--host",
            "--effect",
            effect,
            "--seed",
            "3",
            "--runs",
            "12",
            "--new-runs",
            "6",
            "--json",
            "-",
        ])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Six errors: their rms is within 1 ± 0.65 of its expectation (chi-square of 6 degrees, one in a thousand).
const SCATTER: f64 = 1.65;

#[test]
fn new_runs_are_free_of_the_effect() {
    for effect in ["temperature-rate", "magnet"] {
        let result = close_loop(effect);
        let before = result["rms_before_deg"].as_f64().unwrap();
        let after = result["rms_after_deg"].as_f64().unwrap();
        // White noise over 120 s: 60√2 · 0.0015 / (12.36 · √120) rad = 0.054°, and the uncertainty of the model: three
        // coefficients from twelve runs, √(1 + 3/12) = 1.12; the index adds 0.01°.
        assert!(after < 1.12 * SCATTER * 0.055, "{effect}: {before} {after}");
        assert!(after < before / 2.0, "{effect}: {before} {after}");
    }
}

//! `north calibrate field` from the outside: what it prints, its JSON, its exit codes.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;

fn north(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_north")).args(["calibrate", "field", "--host"]).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A scenario file.
fn scenario(toml: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    fs::write(&path, toml).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (folder, path)
}

#[test]
fn it_guides_shows_before_and_after_and_stores() {
    let output = north(&[]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    for expected in [
        "turn: ",
        "hold still",
        "moved before it was measured: again",
        "attitude 20 accepted, coverage 0.",
        "solving on board",
        "stored",
        "(rms, only judged)",
        "| azimuth | ",
    ] {
        assert!(printed.contains(expected), "{expected} is not in {printed}");
    }
}

#[test]
fn the_json_has_all_of_it() {
    let output = north(&["--json", "-", "--seed", "2"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["engine"], &found["stored"], &found["refused"]), (&"host".into(), &true.into(), &Value::Null));
    let calibration = &found["calibration"];
    let number = |value: &Value| value.as_f64().unwrap();
    assert!(number(&calibration["check_norm_rms_after_g"]) < 0.01 * number(&calibration["check_norm_rms_before_g"]));
    assert!((number(&calibration["bias_g"][0]) - 0.006).abs() < 5e-5);
    assert_eq!(calibration["matrix"][1][0], 0.0);
    assert!(number(&found["before"]["pitch_error_deg"]).abs() > 0.1);
    assert!(number(&found["after"]["pitch_error_deg"]).abs() < 0.01);
    let events = found["events"].as_array().unwrap();
    let held = events.iter().find(|event| event["event"] == "hold-still").unwrap();
    assert!(held["t_s"].is_number() && held["coverage"].is_number() && held["next"].is_array(), "{held}");
}

#[test]
fn a_refusal_has_its_reason_and_exit_code_1() {
    let (_folder, path) = scenario("[base]\nvibration_g = 0.05\n");
    let output = north(&[&path, "--json", "-"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("moving-throughout: the instrument never came to rest"));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["stored"], &found["refused"]), (&false.into(), &"moving-throughout".into()));
    assert_eq!((&found["calibration"], &found["before"]), (&Value::Null, &Value::Null));
}

#[test]
fn an_operator_out_of_range_is_refused_with_its_line() {
    let (_folder, path) = scenario("[operator]\nturn_s = 0.0\n");
    let output = north(&[&path]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains(":2:") && text(&output.stderr).contains("turn_s"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn an_unknown_scenario_is_a_usage_error() {
    assert_eq!(north(&["no-such"]).status.code(), Some(2));
}

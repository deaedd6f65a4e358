//! `north calibrate` by the binary, on recordings that the simulator made.

mod accelerometer_six_position;
mod ellipsoid;
mod models;
mod simulate;
mod six_position;
mod six_position_refusals;

use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

struct Called {
    code: i32,
    stdout: String,
    stderr: String,
}

fn calibrate(folder: &TempDir, arguments: &[&str]) -> Called {
    north(folder, &[&["calibrate"], arguments].concat())
}

fn north(folder: &TempDir, arguments: &[&str]) -> Called {
    let output = Command::new(env!("CARGO_BIN_EXE_north"))
        .args(arguments)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Called {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

impl Called {
    fn json(self) -> Value {
        assert_eq!((self.code, self.stderr.as_str()), (0, ""));
        serde_json::from_str(&self.stdout).unwrap()
    }

    fn text(self) -> String {
        assert_eq!((self.code, self.stderr.as_str()), (0, ""));
        self.stdout
    }

    /// Refused, for a reason that contains this.
    fn refused(self, reason: &str) {
        assert!(self.code == 1 && self.stderr.contains(reason), "{} {}", self.code, self.stderr);
        assert_eq!(self.stdout, "");
    }
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn near(value: &Value, expected: f64, within: f64) {
    let found = value.as_f64().unwrap();
    assert!((found - expected).abs() < within, "{found} {expected}");
}

#[test]
fn usage_errors_have_the_code_2() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "0"]).code, 2);
    assert_eq!(calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "nan"]).code, 2);
    assert_eq!(calibrate(&folder, &["six-position"]).code, 2);
    assert_eq!(calibrate(&folder, &["twelve-position"]).code, 2);
}

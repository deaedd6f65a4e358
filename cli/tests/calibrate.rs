//! `north calibrate` by the binary, on recordings that the simulator made.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use hal_sim::triad::{
    AccelerometerTriad, Knock, Placement, SIX_POSITIONS, Table, TriadErrors, Visit, even_directions, place_by_hand,
};
use serde_json::Value;
use tempfile::TempDir;

struct Called {
    code: i32,
    stdout: String,
    stderr: String,
}

fn calibrate(folder: &TempDir, arguments: &[&str]) -> Called {
    let output = Command::new(env!("CARGO_BIN_EXE_north"))
        .arg("calibrate")
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

/// A triad with an error of each kind.
fn triad() -> TriadErrors {
    TriadErrors {
        bias_deg_h: [0.3, -0.1, 0.05],
        scale_ppm: [2000.0, 0.0, -3000.0],
        // x tilted towards y by 3 mrad, z towards x by −2 mrad.
        tilt_arcsec: [[618.8, 0.0], [0.0, 0.0], [-412.5, 0.0]],
        arw_deg_per_sqrt_h: 0.001,
        bias_instability_deg_h: 0.0,
    }
}

/// Records six positions of 200 s; the table moves at both ends of each file, and the triad is knocked in the second.
fn record(folder: &Path, latitude_deg: f64, declared: &str, axes: impl Fn(usize) -> &'static str) {
    let mut table = Table::new(latitude_deg, &triad(), 5);
    let mut manifest = format!("format = 1\n{declared}\n");
    for (i, position) in SIX_POSITIONS.iter().enumerate() {
        let visit = Visit {
            angles_deg: position.angles_deg,
            seconds: 200.0,
            interval_s: 0.1,
            moves_from_deg: Some([10.0, 20.0, 30.0]),
            move_s: 4.0,
            knocks: if i == 1 { vec![Knock { at_s: 77.3, swing_arcsec: 500.0 }] } else { Vec::new() },
        };
        let mut text = String::from("t_s,temp_c,gz_arcsec,gy_arcsec,gx_arcsec\n");
        for row in table.visit(&visit) {
            let [x, y, z] = row.arcsec;
            writeln!(text, "{:.3},25.0,{z:.7},{y:.7},{x:.7}", row.t_s).unwrap();
        }
        fs::write(folder.join(format!("{i}.csv")), text).unwrap();
        write!(manifest, "[[position]]\nfile = \"{i}.csv\"\naxes = \"{}\"\n", axes(i)).unwrap();
    }
    fs::write(folder.join("calibration.toml"), manifest).unwrap();
}

fn as_it_is(i: usize) -> &'static str {
    SIX_POSITIONS[i].axes
}

fn recorded(declared: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 34.75, declared, as_it_is);
    folder
}

#[test]
fn six_positions_with_moves_and_a_knock() {
    let folder = recorded("latitude_deg = 34.75");
    let result = calibrate(&folder, &["six-position", ".", "--json", "-", "--model-out", "m.toml"]).json();
    assert_eq!(
        keys(&result),
        [
            "bias_deg_h",
            "closure_p_value",
            "closure_rms_deg_h",
            "matrix",
            "published_bias_deg_h",
            "published_matrix",
            "sigma_bias_deg_h",
            "sigma_matrix"
        ]
    );
    // 0.001 °/√h over 200 s: 0.0042 °/h a mean, times √(3/16) for a bias; over Ω cos φ times √(3/8) for a response. Five sigma.
    for (axis, expected) in [0.3, -0.1, 0.05].into_iter().enumerate() {
        near(&result["bias_deg_h"][axis], expected, 5.0 * 0.0019);
        near(&result["sigma_bias_deg_h"][axis], 0.0019, 0.0003);
    }
    for (row, column, expected) in [(0, 0, 1.002), (0, 1, 0.003), (1, 0, 0.0), (2, 0, -0.002), (2, 2, 0.997)] {
        near(&result["matrix"][row][column], expected, 5.0 * 2.2e-4);
        near(&result["published_matrix"][row][column], expected, 5.0 * 3.5e-4);
    }
    assert!(result["closure_p_value"].as_f64().unwrap() > 1e-3);
    let model = fs::read_to_string(folder.path().join("m.toml")).unwrap();
    assert!(model.starts_with("format = 1\n\n[gyro_triad]\nbias_deg_h = ["), "{model}");
}

#[test]
fn the_table_is_printed_for_people() {
    let printed = calibrate(&recorded("latitude_deg = 34.75"), &["six-position", "calibration.toml"]);
    assert_eq!((printed.code, printed.stderr.as_str()), (0, ""));
    for part in ["1.csv", "left out", "least squares", "by differences", "6 closures"] {
        assert!(printed.stdout.contains(part), "{}", printed.stdout);
    }
}

#[test]
fn wrong_latitudes_are_refused() {
    for declared in ["-34.75", "38.5", "30"] {
        let folder = recorded(&format!("latitude_deg = {declared}.0").replace(".75.0", ".75").replace(".5.0", ".5"));
        calibrate(&folder, &["six-position", ".", "--json", "-"]).refused("contradicts the data: they say 34.");
    }
}

#[test]
fn wrong_axes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 34.75, "latitude_deg = 34.75", |i| if i == 4 { "NWU" } else { as_it_is(i) });
    calibrate(&folder, &["six-position", "."]).refused("the closure is not noise");
    record(folder.path(), 34.75, "latitude_deg = 34.75", |i| if i == 4 { "SEU" } else { as_it_is(i) });
    calibrate(&folder, &["six-position", "."]).refused("the closure is not noise");
}

#[test]
fn positions_that_determine_too_little_are_refused() {
    let folder = recorded("latitude_deg = 34.75");
    let path = folder.path().join("calibration.toml");
    let manifest = fs::read_to_string(&path).unwrap();
    let three: String = manifest.split_inclusive("[[position]]").take(4).collect();
    fs::write(&path, three.trim_end_matches("[[position]]")).unwrap();
    calibrate(&folder, &["six-position", "."])
        .refused("the positions do not determine the responses to rotation about x");
}

#[test]
fn what_is_wrong_with_the_manifest_is_named_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    for (text, error) in [
        ("format = 2\n", "calibration.toml, line 1, column 10: \"format = 2\" is not allowed; allowed is format = 1"),
        (
            "format = 1\nlatitude_deg = 99.0\n",
            "line 2, column 16: \"latitude_deg = 99\" is not allowed; allowed is -90 to 90",
        ),
        ("format = 1\nlatitude_deg = 9.0\n", "no [[position]] is listed"),
        (
            "format = 1\nlatitude_deg = 9.0\n[[position]]\nfile = \"a.csv\"\naxes = \"NEU\"\n",
            "line 5, column 8: \"axes = NEU\" is not",
        ),
        ("format = 1\nlatitude_deg = 9.0\n[[position]]\nfile = \"a.csv\"\naxes = \"ENU\"\n", "a.csv: No such file"),
    ] {
        fs::write(folder.path().join("calibration.toml"), text).unwrap();
        calibrate(&folder, &["six-position", "."]).refused(error);
    }
}

/// A triad in counts.
fn counts() -> AccelerometerTriad {
    AccelerometerTriad {
        zero: [33_100.0, 33_300.0, 32_400.0],
        per_g: [4060.0, 4040.0, 4080.0],
        tilt_arcsec: [[0.0, 0.0], [2000.0, 0.0], [0.0, 0.0]],
        noise: 3.0,
        counts: true,
        ..AccelerometerTriad::default()
    }
}

fn placement(up: Vec<[f64; 3]>) -> Placement {
    Placement { up, rest_s: 3.0, move_s: 1.5, rate_hz: 100.0, shake_g: 0.03, rest_shake_g: 0.0 }
}

fn write_readings(folder: &TempDir, placement: &Placement) {
    let mut text = String::from("t_s,ax_raw,ay_raw,az_raw,gx_raw\n");
    for reading in place_by_hand(&counts(), placement, 2) {
        let [x, y, z] = reading.raw;
        writeln!(text, "{:.3},{x},{y},{z},0", reading.t_s).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
}

#[test]
fn an_ellipsoid_from_a_continuous_recording_of_counts() {
    let folder = tempfile::tempdir().unwrap();
    write_readings(&folder, &placement(even_directions(24, 3)));
    let arguments = ["ellipsoid", "a.csv", "--gravity", "9.81", "--json", "-", "--model-out", "m.toml"];
    let result = calibrate(&folder, &arguments).json();
    assert_eq!(
        keys(&result),
        [
            "attitudes",
            "bias",
            "check_norm_rms_after",
            "coverage",
            "matrix",
            "norm_rms_after",
            "norm_rms_before",
            "rejected",
            "sigma_bias"
        ]
    );
    assert_eq!(result["attitudes"], 24);
    for (axis, expected) in [33_100.0, 33_300.0, 32_400.0].into_iter().enumerate() {
        near(&result["bias"][axis], expected, 1.5);
    }
    near(&result["matrix"][2][2], 9.81 / 4080.0, 1e-6);
    near(&result["matrix"][1][0], 0.0, 1e-30);
    // 3 counts of noise over 2.5 s are 0.02 counts, 5e-5 m/s²; before, one factor for all: half a per cent of 9.81.
    assert!(result["check_norm_rms_after"].as_f64().unwrap() < 1e-3);
    assert!(result["norm_rms_before"].as_f64().unwrap() > 0.05);

    // The file that was written, judged by its own recording.
    let printed = calibrate(&folder, &["ellipsoid", "a.csv", "--compare", "m.toml"]);
    assert!(printed.stdout.contains("only judged 0.0000"), "{}", printed.stdout);
}

#[test]
fn an_ellipsoid_from_ten_readings_an_attitude_with_outliers() {
    let folder = tempfile::tempdir().unwrap();
    let triad = AccelerometerTriad { noise: 2e-4, zero: [0.02, 0.0, -0.01], ..AccelerometerTriad::default() };
    let placement = Placement { rest_s: 10.0, move_s: 0.0, rate_hz: 1.0, ..placement(even_directions(23, 8)) };
    let mut text = String::from("attitude,ax,ay,az\n");
    for (i, reading) in place_by_hand(&triad, &placement, 2).iter().enumerate() {
        let [x, y, z] = if i == 54 { [0.0, 5.0, 0.0] } else { reading.raw };
        writeln!(text, "{},{x},{y},{z}", reading.attitude.unwrap() + 100).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let result = calibrate(&folder, &["ellipsoid", "a.csv", "--json", "-"]).json();
    near(&result["bias"][0], 0.02, 3e-4);
    near(&result["bias"][2], -0.01, 3e-4);
    assert_eq!(result["rejected"][0]["attitude"], 105.0);
    assert_eq!(result["rejected"][0]["readings"], 1);
}

#[test]
fn badly_spread_attitudes_are_refused_with_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let up: Vec<_> = even_directions(40, 3).into_iter().filter(|up| up[2] > 0.1).collect();
    write_readings(&folder, &placement(up));
    calibrate(&folder, &["ellipsoid", "a.csv"]).refused("missing, with this way up: -z");
    write_readings(&folder, &placement(even_directions(8, 3)));
    calibrate(&folder, &["ellipsoid", "a.csv"]).refused("8 attitudes to learn from; at least 9 are needed");
}

#[test]
fn a_triad_that_moves_throughout_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_readings(&folder, &Placement { rest_s: 0.0, move_s: 3.0, ..placement(even_directions(30, 3)) });
    calibrate(&folder, &["ellipsoid", "a.csv"]).refused("moves throughout");
}

#[test]
fn readings_on_no_ellipsoid_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("attitude,ax,ay,az\n");
    for (i, [x, y, z]) in even_directions(30, 3).into_iter().enumerate() {
        // A cube.
        let far = 1.0 / [x, y, z].into_iter().map(f64::abs).fold(0.0, f64::max);
        for k in 0..10 {
            let rough = 1e-4 * f64::from(k % 3);
            writeln!(text, "{i},{},{},{}", far * x + rough, far * y - rough, far * z).unwrap();
        }
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    calibrate(&folder, &["ellipsoid", "a.csv"]).refused("do not lie on an ellipsoid");
}

#[test]
fn usage_errors_have_the_code_2() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "0"]).code, 2);
    assert_eq!(calibrate(&folder, &["six-position"]).code, 2);
}

#[test]
fn simulated_recordings_are_calibrated_to_their_truth() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(calibrate(&folder, &["simulate", "ellipsoid", "--out", "hand", "--seed", "4"]).code, 0);
    let printed = calibrate(&folder, &["ellipsoid", "hand/readings.csv", "--compare", "hand/truth.toml"]);
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    let arguments = ["simulate", "six-position", "--out", "table", "--seconds", "120"];
    assert_eq!(calibrate(&folder, &arguments).code, 0);
    let result = calibrate(&folder, &["six-position", "table", "--json", "-"]).json();
    let truth: toml::Table = fs::read_to_string(folder.path().join("table/truth.toml")).unwrap().parse().unwrap();
    for axis in 0..3 {
        let expected = truth["gyro_triad"]["bias_deg_h"][axis].as_float().unwrap();
        near(&result["bias_deg_h"][axis], expected, 5.0 * result["sigma_bias_deg_h"][axis].as_f64().unwrap());
    }
    assert_eq!(calibrate(&folder, &arguments).code, 1);
}

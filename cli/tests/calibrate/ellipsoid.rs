//! `north calibrate ellipsoid`.

use std::fmt::Write;
use std::fs;

use hal_sim::triad::{AccelerometerTriad, Placement, even_directions, place_by_hand};
use tempfile::TempDir;

use super::{calibrate, keys, near};

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
            "angles_deg",
            "attitudes",
            "bias",
            "check_norm_rms_after",
            "compared",
            "coverage",
            "excess_rms",
            "gravity",
            "half_axes",
            "judged",
            "learned_from",
            "matrix",
            "norm_rms_after",
            "norm_rms_before",
            "rejected",
            "scale",
            "sigma_bias",
            "sigma_matrix"
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
    near(&result["scale"][2], 4080.0 / 9.81, 0.2);
    let together = ["learned_from", "judged"].map(|name| result[name].as_u64().unwrap());
    assert!(together.iter().sum::<u64>() == 24 && result["compared"].is_null(), "{result}");
    let compared = ["ellipsoid", "a.csv", "--gravity", "9.81", "--compare", "m.toml", "--json", "-"];
    let compared = calibrate(&folder, &compared).json();
    near(&compared["compared"]["judged_rms"], compared["check_norm_rms_after"].as_f64().unwrap(), 1e-9);
    near(&compared["compared"]["learned_from_rms"], compared["norm_rms_after"].as_f64().unwrap(), 1e-9);

    // A gravity that is in no unit of the other commands.
    let odd = calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "1000", "--model-out", "odd.toml"]);
    assert!(
        odd.code == 0 && odd.stderr.contains("odd.toml: gravity 1000 is neither in g nor in m/s2"),
        "{}",
        odd.stderr
    );
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
fn few_attitudes_are_learned_from_rather_than_judged() {
    // Both ways along the axes and six of the twelve directions between: none of them can be spared.
    let folder = tempfile::tempdir().unwrap();
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let between = [[1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let up = axes.into_iter().chain(between).flat_map(|up| [up, up.map(|part: f64| -part)]).collect();
    write_readings(&folder, &placement(up));
    let result = calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "9.81", "--json", "-"]).json();
    assert_eq!(result["attitudes"], 12);
    near(&result["matrix"][2][2], 9.81 / 4080.0, 3e-6);
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
fn what_is_wrong_with_the_file_is_named_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    calibrate(&folder, &["ellipsoid", "a.csv"]).refused("a.csv: No such file");
    for (text, error) in [
        ("", "a.csv: the file is empty"),
        ("t_s,ax,ay,az\n", "a.csv: no data rows"),
        ("t_s,ax,ay\n1,2,3\n", "a.csv, line 1: column `az` is missing; the header has: t_s, ax, ay"),
        ("t_s,ax,ay,az\n1,2,3,inf\n", "a.csv, line 2, column 4 (az): \"inf\" is not allowed"),
        ("attitude,ax,ay,az\n1,2,3,4\n1,2,three,4\n", "a.csv, line 3, column 3 (ay): \"three\" is not allowed"),
        ("attitude,ax,ay,az\n1,2,3\n", "a.csv, line 2: 3 fields; the header has 4"),
        ("t_s,ax,ay,az\n2,0,0,1\n1,0,0,1\n", "a.csv, line 3, column 1 (t_s): time 1 is not later"),
        ("t_s,ax,ay,az\n1,0,0,1\n", "a.csv: 0.0 s of readings are too short a recording"),
    ] {
        fs::write(folder.path().join("a.csv"), text).unwrap();
        calibrate(&folder, &["ellipsoid", "a.csv"]).refused(error);
    }
}

#[test]
fn an_attitude_that_contradicts_the_others_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let triad = AccelerometerTriad { noise: 1e-3, ..AccelerometerTriad::default() };
    let placement = Placement { rest_s: 10.0, move_s: 0.0, rate_hz: 1.0, ..placement(even_directions(23, 8)) };
    let mut text = String::from("attitude,ax_m_s2,ay_m_s2,az_m_s2\n");
    for reading in place_by_hand(&triad, &placement, 2) {
        // Held in a hand that lifts it: 0.2 g too much in all readings of one attitude.
        let lifted = if reading.attitude == Some(7) { 1.2 } else { 1.0 };
        let [x, y, z] = reading.raw.map(|part| 9.81 * lifted * part);
        writeln!(text, "{},{x},{y},{z}", reading.attitude.unwrap()).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let result = calibrate(&folder, &["ellipsoid", "a.csv", "--gravity", "9.81", "--json", "-"]).json();
    assert_eq!(result["attitudes"], 22);
    assert_eq!(result["rejected"][0]["attitude"], 7.0);
    assert_eq!(result["rejected"][0]["why"], "its norm contradicts that of the others");
    near(&result["matrix"][0][0], 1.0, 2e-3);
}

#[test]
fn every_unit_has_its_digits() {
    // 0.01 g with a sigma of 3e-4/√180 · √3, 4e-5: two digits of it are seen.
    for (unit, bias, sigma) in [(1e-6, "+0.0000000099", "± 0.00000000004"), (1e6, "+99", "± 4")] {
        let folder = tempfile::tempdir().unwrap();
        let triad = AccelerometerTriad {
            noise: 3e-4 * unit,
            zero: [0.01 * unit, 0.0, 0.0],
            per_g: [unit; 3],
            ..AccelerometerTriad::default()
        };
        let placement = Placement { rest_s: 10.0, move_s: 0.0, rate_hz: 1.0, ..placement(even_directions(23, 8)) };
        let mut text = String::from("attitude,ax,ay,az\n");
        for reading in place_by_hand(&triad, &placement, 2) {
            let [x, y, z] = reading.raw;
            writeln!(text, "{},{x:e},{y:e},{z:e}", reading.attitude.unwrap()).unwrap();
        }
        fs::write(folder.path().join("a.csv"), text).unwrap();
        let printed = calibrate(&folder, &["ellipsoid", "a.csv"]).text();
        assert!(printed.contains(bias) && printed.contains(sigma), "{printed}");
    }
}

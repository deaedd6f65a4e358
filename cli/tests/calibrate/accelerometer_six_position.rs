//! `north calibrate accelerometer-six-position`, and the misalignments of one calibration in another.

use std::fmt::Write;
use std::fs;

use hal_sim::triad::{AccelerometerTriad, Placement, even_directions, place_by_hand};
use tempfile::TempDir;

use super::{calibrate, near};

/// In m/s²: biases 0.2, −0.1, 0.05; scale factors 1.01, 0.99, 1.005; y leans 1000″ towards x.
fn triad() -> AccelerometerTriad {
    AccelerometerTriad {
        zero: [0.2, -0.1, 0.05],
        per_g: [1.01, 0.99, 1.005].map(|scale| scale * GRAVITY),
        tilt_arcsec: [[0.0, 0.0], [1000.0, 0.0], [0.0, 0.0]],
        noise: 0.01,
        ..AccelerometerTriad::default()
    }
}

/// Normal gravity at 45° N and sea level, m/s², by hand: 9.7803253359 · (1 + 0.00193185265/2)/√(1 − 0.00669437999/2).
const GRAVITY: f64 = 9.806_197_8;

fn faces() -> Vec<[f64; 3]> {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    axes.into_iter().flat_map(|up| [up, up.map(|part: f64| -part)]).collect()
}

/// A continuous recording: four seconds at rest in each attitude.
fn write_readings(folder: &TempDir, triad: &AccelerometerTriad, up: Vec<[f64; 3]>) {
    let placement = Placement { up, rest_s: 4.0, move_s: 1.5, rate_hz: 100.0, shake_g: 0.03, rest_shake_g: 0.0 };
    let mut text = String::from("t_s,ax_m_s2,ay_m_s2,az_m_s2\n");
    for reading in place_by_hand(triad, &placement, 5) {
        let [x, y, z] = reading.raw;
        writeln!(text, "{:.3},{x},{y},{z}", reading.t_s).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
}

#[test]
fn six_faces_give_biases_and_scale_factors_and_a_square_box_misalignments() {
    let folder = tempfile::tempdir().unwrap();
    write_readings(&folder, &triad(), faces());
    let rough = ["accelerometer-six-position", "a.csv", "--latitude", "45", "--json", "-"];
    let result = calibrate(&folder, &rough).json();
    assert_eq!((&result["attitudes"], &result["closures"], &result["square"]), (&6.into(), &0.into(), &false.into()));
    near(&result["gravity"], GRAVITY, 1e-5);
    // 0.01 m/s² over some 3 s at 100 Hz: 0.0006 of a mean, 0.0004 of a bias, five sigma.
    for (axis, (bias, scale)) in [(0.2, 1.01), (-0.1, 0.99), (0.05, 1.005)].into_iter().enumerate() {
        near(&result["bias"][axis], bias, 0.0022);
        near(&result["scale"][axis], scale, 0.0022 / GRAVITY + 12e-6);
        let sigma = result["sigma_bias"][axis].as_f64().unwrap();
        assert!((0.0003..0.0006).contains(&sigma), "{sigma}");
    }
    let square = [&rough[..], &["--square-arcsec", "10"]].concat();
    let result = calibrate(&folder, &square).json();
    assert_eq!(result["closures"], 6);
    // What y reads of x is taken out again: −0.99 · 1000″ in the readings, over both scale factors.
    near(&result["matrix"][1][0], -1000.0 / 206_264.8 / 1.01, 4e-4);
    near(&result["matrix"][0][1], 0.0, 4e-4);
}

#[test]
fn gravity_and_what_was_not_looked_for_are_said() {
    let folder = tempfile::tempdir().unwrap();
    write_readings(&folder, &triad(), faces());
    let said = calibrate(&folder, &["accelerometer-six-position", "a.csv", "--latitude", "45"]).text();
    assert!(said.starts_with("gravity 9.806198 m/s2: normal gravity (WGS 84) at 45 deg, 0 m\n"), "{said}");
    assert!(said.contains("misalignments were not looked for") && said.contains("\n      -y "), "{said}");
    let said = calibrate(&folder, &["accelerometer-six-position", "a.csv"]).text();
    assert!(said.starts_with("gravity 1: forces are in units of the local gravity"), "{said}");
    let both = ["accelerometer-six-position", "a.csv", "--latitude", "45", "--gravity", "9.8"];
    assert_eq!(calibrate(&folder, &both).code, 2);
}

#[test]
fn faces_that_lean_widen_the_sigmas_and_are_told() {
    let folder = tempfile::tempdir().unwrap();
    // x up leans by 0.03 to y and x down by 0.02 to z: x reads (0.03² + 0.02²)/4 = 325 ppm too little; the other faces are true.
    let mut up = faces();
    (up[0], up[1]) = ([(1.0_f64 - 0.0009).sqrt(), 0.03, 0.0], [-(1.0_f64 - 0.0004).sqrt(), 0.0, 0.02]);
    let orthogonal = AccelerometerTriad { tilt_arcsec: [[0.0; 2]; 3], noise: 0.001, ..triad() };
    write_readings(&folder, &orthogonal, up);
    let command = ["accelerometer-six-position", "a.csv", "--latitude", "45"];
    let result = calibrate(&folder, &[&command[..], &["--json", "-"]].concat()).json();
    let scale = result["scale"][0].as_f64().unwrap() / 1.01 - 1.0;
    let sigma = result["sigma_scale"][0].as_f64().unwrap() / 1.01;
    // Noise is 4 ppm; the sigma √((450² + 200²)/2) = 348 ppm.
    assert!((scale + 325e-6).abs() < 25e-6 && (sigma / 348e-6 - 1.0).abs() < 0.05, "{scale} {sigma}");
    assert!(result["sigma_scale"][1].as_f64().unwrap() < 20e-6, "{result}");
    near(&result["greatest_lean_deg"], 0.03_f64.to_degrees(), 0.01);
    for (axis, (bias, scale)) in [(0.2, 1.01), (-0.1, 0.99), (0.05, 1.005)].into_iter().enumerate() {
        near(&result["by_norm"]["bias"][axis], bias, 3e-4);
        near(&result["by_norm"]["scale"][axis], scale, 4e-5);
    }
    let said = calibrate(&folder, &command).text();
    assert!(said.contains("up to 1.72 deg of gravity") && said.contains("by the norm of the readings"), "{said}");
}

#[test]
fn a_face_that_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut up = faces();
    up.remove(3);
    // x, z both ways; y up only: its readings range over half of the others'.
    write_readings(&folder, &triad(), up);
    calibrate(&folder, &["accelerometer-six-position", "a.csv"]).refused("the y axis was not both up and down");
}

#[test]
fn misalignments_of_a_square_box_serve_the_field() {
    let folder = tempfile::tempdir().unwrap();
    write_readings(&folder, &triad(), faces());
    let turntable = ["accelerometer-six-position", "a.csv", "--square-arcsec", "3", "--latitude", "45"];
    calibrate(&folder, &[&turntable[..], &["--model-out", "turntable.toml"]].concat()).text();
    // A month later: another bias, the same misalignments, nine attitudes and some more in the field.
    let aged = AccelerometerTriad { zero: [0.3, -0.2, 0.1], ..triad() };
    write_readings(&folder, &aged, even_directions(23, 3));
    let field = ["ellipsoid", "a.csv", "--latitude", "45", "--json", "-"];
    let alone = calibrate(&folder, &field).json();
    let combined = calibrate(&folder, &[&field[..], &["--prior", "turntable.toml"]].concat()).json();
    for result in [&alone, &combined] {
        near(&result["bias"][0], 0.3, 0.003);
        near(&result["bias"][1], -0.2, 0.003);
    }
    assert_ne!(alone["matrix"], combined["matrix"]);
    // In the frame of the sensors −m12/m22 is the part of x's axis along y: 1000″.
    let part = |of: &serde_json::Value| {
        -of["matrix"][0][1].as_f64().unwrap() / of["matrix"][1][1].as_f64().unwrap() - 1000.0 / 206_264.8
    };
    assert!(part(&combined).abs() < 3e-4, "{} {}", part(&alone), part(&combined));
    let said = calibrate(&folder, &[&field[..4], &["--prior", "turntable.toml"]].concat()).text();
    assert!(said.contains("misalignments combined with those of turntable.toml"), "{said}");
    // A box of which nobody said how square it is tells no misalignments.
    write_readings(&folder, &triad(), faces());
    let rough = ["accelerometer-six-position", "a.csv", "--latitude", "45", "--model-out", "rough.toml"];
    calibrate(&folder, &rough).text();
    calibrate(&folder, &["ellipsoid", "a.csv", "--prior", "rough.toml"])
        .refused("rough.toml: its misalignments were not estimated");
}

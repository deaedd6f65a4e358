//! Every calibration's model, in every command that takes a model: understood, or refused by name.

use std::fmt::Write;
use std::fs;

use hal_sim::triad::{AccelerometerTriad, Placement, even_directions, place_by_hand};
use tempfile::TempDir;

use super::{calibrate, near, north};

/// A level triad at 34.75° N heading 40°, its x gyro with a bias of 0.5 °/h, read at four virtual index angles: 30 s at each.
/// Forward and left feel 12.3585 °/h · cos 40° = 9.467 and, left of it, 12.3585 · sin 40° = 7.944.
const FORWARD_DEG_H: f64 = 9.467_161;
const LEFT_DEG_H: f64 = 7.943_890;

fn write_campaign(folder: &TempDir) {
    let mut text = String::from("t_s,index_deg,fog_arcsec,ax_g,ay_g\n");
    for second in 0..120 {
        let position = second / 30;
        let (forward, left) = (FORWARD_DEG_H + 0.5, LEFT_DEG_H);
        let rate = [forward, left, -forward, -left][position];
        // A little noise that cancels in pairs: a gyro that repeats one reading is refused.
        let noise = if second % 2 == 0 { 0.05 } else { -0.05 };
        writeln!(text, "{},{},{},0.0,0.0", second + 1, 90 * position, rate + noise).unwrap();
    }
    fs::create_dir(folder.path().join("c")).unwrap();
    fs::write(folder.path().join("c/r.csv"), text).unwrap();
    let manifest = "format = 1\nlatitude_deg = 34.75\n[[run]]\nfile = \"r.csv\"\nreference_azimuth_deg = 40\n";
    fs::write(folder.path().join("c/campaign.toml"), manifest).unwrap();
}

/// A model of every kind: by the calibrations themselves, and a gyro triad and an error model by hand.
fn write_models(folder: &TempDir) {
    let triad = AccelerometerTriad { zero: [0.003, -0.002, 0.0], noise: 3e-4, ..AccelerometerTriad::default() };
    let faces = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let faces = faces.into_iter().flat_map(|up| [up, up.map(|part: f64| -part)]).collect();
    for (file, up) in [("a.csv", even_directions(23, 4)), ("faces.csv", faces)] {
        let placement = Placement { up, rest_s: 10.0, move_s: 0.0, rate_hz: 1.0, shake_g: 0.0, rest_shake_g: 0.0 };
        let mut text = String::from("attitude,ax_g,ay_g,az_g\n");
        for reading in place_by_hand(&triad, &placement, 2) {
            let [x, y, z] = reading.raw;
            writeln!(text, "{},{x},{y},{z}", reading.attitude.unwrap()).unwrap();
        }
        fs::write(folder.path().join(file), text).unwrap();
    }
    calibrate(folder, &["ellipsoid", "a.csv", "--model-out", "ellipsoid.toml"]).text();
    let faces = ["accelerometer-six-position", "faces.csv", "--square-arcsec", "10", "--model-out", "faces.toml"];
    calibrate(folder, &faces).text();
    calibrate(folder, &["simulate", "six-position", "--out", "table", "--seconds", "120"]).text();
    calibrate(folder, &["six-position", "table", "--model-out", "six.toml"]).text();
    let triad = "format = 1\n[gyro_triad]\nbias_deg_h = [0.5, 0.0, 3.0]\nmatrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, \
                 0.0, 1.0]]\n";
    fs::write(folder.path().join("triad.toml"), triad).unwrap();
    fs::write(folder.path().join("gyro.toml"), "format = 1\nscale_error = 0.001\n").unwrap();
    let all = fs::read_to_string(folder.path().join("ellipsoid.toml")).unwrap();
    let all = all.replace("format = 1\n", "format = 1\nscale_error = 0.001\n") + &triad.replace("format = 1\n", "");
    fs::write(folder.path().join("all.toml"), all).unwrap();
}

#[test]
fn every_model_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    write_campaign(&folder);
    write_models(&folder);
    let fast = ["--host", "--order", "plain", "--dwell", "2", "--json", "-"];
    for (model, gyro, triad, accelerometer) in [
        ("gyro.toml", true, false, false),
        ("six.toml", false, true, false),
        ("triad.toml", false, true, false),
        ("ellipsoid.toml", false, false, true),
        ("faces.toml", false, false, true),
        ("all.toml", true, true, true),
    ] {
        assert!(gyro || triad || accelerometer);
        // Commands that learn from recordings take them all.
        for command in ["solve", "diagnose"] {
            let called = north(&folder, &[command, "c", "--model", model]);
            assert_eq!(called.code, 0, "{command} {model}: {}", called.stderr);
            let noted = [("gyro triad", triad), ("accelerometer triad", accelerometer)];
            for (words, expected) in noted.into_iter().filter(|_| command == "solve") {
                assert_eq!(
                    called.stdout.contains(&format!(
                        "note: model of a{} {words}",
                        if words.starts_with('a') { "n" } else { "" }
                    )),
                    expected,
                    "{model}: {}",
                    called.stdout
                );
            }
        }
        // A board has one gyro.
        let called = north(&folder, &[&["find", "--model", model], &fast[..]].concat());
        if triad {
            called.refused("the model of the instrument's one indexed gyro");
        } else {
            assert!(called.code == 0, "find {model}: {}", called.stderr);
        }
        // Calibrations of accelerometers take those of accelerometers.
        for option in ["--prior", "--compare"] {
            let called = calibrate(&folder, &["ellipsoid", "a.csv", option, model]);
            if accelerometer {
                assert_eq!(called.code, 0, "{option} {model}: {}", called.stderr);
            } else {
                called.refused("it has no table [accelerometer]");
            }
        }
    }
}

#[test]
fn a_triads_biases_are_taken_out_of_a_virtual_index() {
    let folder = tempfile::tempdir().unwrap();
    write_campaign(&folder);
    write_models(&folder);
    let azimuth = |model: &[&str]| {
        let result = north(&folder, &[&["solve", "c", "--json", "-"], model].concat()).json();
        result["runs"][0]["azimuth_deg"].clone()
    };
    // Forward reads 0.5 °/h too much at both ends of its pair: atan2(7.943890, 9.967161) = 38.5551°; nothing flags
    // it. What the alternating noise leaves of itself: 0.0025°.
    near(&azimuth(&[]), 38.5551, 5e-3);
    near(&azimuth(&["--model", "triad.toml"]), 40.0, 5e-3);
}

#[test]
fn what_makes_no_sense_in_a_model_is_named_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    write_campaign(&folder);
    for (text, place) in [
        ("format = 1\nscale_error = 0.5\n", "m.toml, line 2, column 15: \"scale_error = 0.5\" is not allowed"),
        ("format = 1\nbias = 0.5\n", "m.toml, line 2, column 1: unknown field `bias`"),
        (
            "format = 1\n[gyro_triad]\nbias_deg_h = [nan, 0.0, 0.0]\nmatrix = [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,1.0]]\n",
            "m.toml, line 3, column 14: \"NaN\" is not allowed",
        ),
        ("format = 1\n[gyro_triad]\nbias = [0.0, 0.0, 0.0]\n", "m.toml, line 3, column 1: unknown field `bias`"),
        (
            "format = 1\n[accelerometer]\ngravity = -1.0\nbias = [0.0, 0.0, 0.0]\nmatrix = [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,1.0]]\n",
            "m.toml, line 3, column 11: \"-1\" is not allowed; allowed is a positive number",
        ),
        (
            "format = 2\nterms = [\n{ coefficients = [0.1], basis = { step = { t_s = 1.0 } } },\n{ coefficients = [1e300], basis = { step = { t_s = 1.0 } } },\n]\n",
            "m.toml, line 4, column 19: \"terms[2].coefficients[1] = 1e300\" is not allowed; allowed is a number within ±3.4e38",
        ),
        (
            "format = 2\n[[effects]]\nport = \"rate\"\nweights = [0.1]\n[[effects]]\nport = \"scale\"\nweights = [0.1, 0.2]\n",
            "m.toml, line 7, column 11: \"effects[2].weights (number) = 2\" is not allowed; allowed is one for every product",
        ),
        (
            "format = 2\n[[effects]]\nport = \"rate\"\nweights = [0.1]\n[[effects]]\nport = \"scale\"\nweights = [inf]\n",
            "m.toml, line 7, column 12: \"effects[2].weights[1] = inf\" is not allowed; allowed is a finite number",
        ),
    ] {
        fs::write(folder.path().join("m.toml"), text).unwrap();
        north(&folder, &["solve", "c", "--model", "m.toml"]).refused(place);
    }
}

//! `north calibrate six-position`: what it refuses, and that it says why and where.

use std::fs;

use hal_sim::triad::{SIX_POSITIONS, TriadErrors, Visit, Warming};
use tempfile::TempDir;

use super::calibrate;
use super::six_position::{Set, triad};

impl Set {
    /// That the command refuses what is recorded, for a reason that contains this.
    pub fn refused(&self, reason: &str) {
        refused(&self.record(), reason);
    }
}

fn refused(folder: &TempDir, reason: &str) {
    calibrate(folder, &["six-position", ".", "--json", "-"]).refused(reason);
}

#[test]
fn wrong_latitudes() {
    for declared_deg in [-34.75, 38.5, 30.0] {
        let declared = format!("latitude_deg = {declared_deg:?}");
        Set { declared, ..Set::new() }
            .refused(&format!("latitude_deg = {declared_deg} contradicts the data: they say 34."));
    }
    Set { declared: "latitude_deg = 89.5".into(), ..Set::new() }.refused("pole");
}

#[test]
fn axes_that_are_not_those_of_the_recording() {
    let closure = "calibration.toml: the closure is not noise";
    Set { axes: |i| if i == 4 { "NWU" } else { SIX_POSITIONS[i].axes }, ..Set::new() }.refused(closure);
    Set { axes: |i| if i == 4 { "SEU" } else { SIX_POSITIONS[i].axes }, ..Set::new() }.refused(closure);
    // Two files exchanged.
    let exchanged = "with the axes of positions 3 and 4 exchanged all agree";
    Set { axes: |i| SIX_POSITIONS[[0, 1, 3, 2, 4, 5][i]].axes, ..Set::new() }.refused(exchanged);
}

#[test]
fn a_bias_that_follows_the_temperature() {
    let errors = TriadErrors { bias_deg_h_per_k: [0.01, 0.0, 0.02], ..triad() };
    // One position is warmer.
    let warmer = |i, visit| if i == 3 { Visit { temp_c: 30.0, ..visit } } else { visit };
    let set = Set { errors, visit: warmer, ..Set::new() };
    set.refused("the temperature differs from 25.0 to 30.0 C between the positions");
    // It becomes so while it is recorded.
    let warming = |i, visit| match i {
        3 => Visit { warming: Some(Warming { at_s: 100.0, by_k: 10.0 }), ..visit },
        _ => visit,
    };
    Set { visit: warming, ..set }.refused("the closure is not noise");
}

#[test]
fn positions_that_determine_too_little() {
    let folder = Set::new().record();
    let path = folder.path().join("calibration.toml");
    let manifest = fs::read_to_string(&path).unwrap();
    let three: String = manifest.split_inclusive("[[position]]").take(4).collect();
    fs::write(&path, three.trim_end_matches("[[position]]")).unwrap();
    refused(&folder, "the positions do not determine the responses to rotation about x");
}

#[test]
fn a_triad_that_does_not_rest() {
    // It turns slowly all the time.
    let folder = Set { visit: |_, visit| Visit { move_s: 100.0, ..visit }, ..Set::new() }.record();
    refused(&folder, "0.csv: the triad was at rest for only");
}

#[test]
fn gyros_that_are_exchanged() {
    let folder = Set::new().record();
    for position in 0..6 {
        let path = folder.path().join(format!("{position}.csv"));
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen("gz_arcsec,gy_arcsec", "gy_arcsec,gz_arcsec", 1)).unwrap();
    }
    let called = calibrate(&folder, &["six-position", "."]);
    assert_eq!(called.code, 1, "{}", called.stdout);
}

#[test]
fn what_is_wrong_with_the_manifest_is_named_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    refused(&folder, "calibration.toml: No such file");
    let listed =
        |axes: &str| format!("format = 1\nlatitude_deg = 9.0\n[[position]]\nfile = \"a.csv\"\naxes = \"{axes}\"\n");
    for (text, error) in [
        ("latitude_deg = 9.0\n".into(), "calibration.toml: the first line must be `format = 1`"),
        (
            "format = 2\n".into(),
            "calibration.toml, line 1, column 10: \"format = 2\" is not allowed; allowed is format = 1",
        ),
        ("format = 1\nlatitude_deg = \n".into(), "calibration.toml, line 2, column 16: "),
        ("format = 1\n".into(), "missing field `latitude_deg`"),
        (
            "format = 1\nlatitude_deg = 99.0\n".into(),
            "line 2, column 16: \"latitude_deg = 99\" is not allowed; allowed is -90 to 90",
        ),
        ("format = 1\nlatitude_deg = nan\n".into(), "\"latitude_deg = NaN\" is not allowed"),
        ("format = 1\nlatitude_deg = 9.0\n".into(), "no [[position]] is listed"),
        ("format = 1\nlatitude_deg = 9.0\nsite = \"x\"\n".into(), "line 3, column 1: unknown field `site`"),
        (listed("NEU"), "line 5, column 8: \"axes = NEU\" is not allowed; allowed is a right-handed triad"),
        (listed("EEU"), "line 5, column 8: \"axes = EEU\" is not allowed; allowed is three directions at right angles"),
        (
            listed("ENX"),
            "line 5, column 8: \"axes = ENX\" is not allowed; allowed is three letters of E, W, N, S, U, D",
        ),
        (
            format!("{}[[position]]\nfile = \"a.csv\"\naxes = \"WSU\"\n", listed("ENU")),
            "line 7, column 8: \"file = a.csv\" is not allowed; allowed is a file listed only once",
        ),
        (listed("ENU"), "a.csv: No such file"),
    ] {
        fs::write(folder.path().join("calibration.toml"), text).unwrap();
        refused(&folder, error);
    }
}

#[test]
fn what_is_wrong_with_a_recording_is_named_with_its_place() {
    let folder = Set::new().record();
    let path = folder.path().join("3.csv");
    let whole = fs::read_to_string(&path).unwrap();
    let lines: Vec<_> = whole.lines().collect();
    let with_line = |number: usize, line: &str| {
        let mut lines = lines.clone();
        lines[number - 1] = line;
        lines.join("\n")
    };
    let without = |from: usize, to: usize| [&lines[..from - 1], &lines[to..]].concat().join("\n");
    for (text, error) in [
        (String::new(), "3.csv: the file is empty"),
        (lines[0].into(), "3.csv: no data rows follow the header"),
        (without(13, lines.len()), "3.csv: 11 intervals of rest and motion; at least 16 are needed"),
        (
            with_line(1, "t_s,temp_c,gz_arcsec,gy_arcsec,gx"),
            "3.csv, line 1: column `gx_arcsec` is missing; the header has: t_s, temp_c, gz_arcsec, gy_arcsec, gx",
        ),
        (
            with_line(1, "t_s,gx_arcsec,gz_arcsec,gy_arcsec,gx_arcsec"),
            "3.csv, line 1, column 5 (gx_arcsec): column name \"gx_arcsec\" appears twice",
        ),
        (with_line(700, "69.900,25.0,NaN,0,0"), "3.csv, line 700, column 3 (gz_arcsec): \"NaN\" is not allowed"),
        (with_line(700, "69.900,25.0,1.0"), "3.csv, line 700: 3 fields; the header has 5"),
        (with_line(700, "3.0,25.0,1,1,1"), "3.csv, line 700, column 1 (t_s): time 3 is not later"),
        (
            without(700, 719),
            "3.csv, line 700, column 1 (t_s): \"a step of 2.1000 s\" is not allowed; allowed is at most 1.5",
        ),
    ] {
        fs::write(&path, text).unwrap();
        refused(&folder, error);
    }
    fs::remove_file(&path).unwrap();
    refused(&folder, "3.csv: No such file");
}

#[test]
fn a_result_that_cannot_be_written() {
    let folder = Set::new().record();
    calibrate(&folder, &["six-position", ".", "--json", "-", "--model-out", "nowhere/m.toml"]);
    let called = calibrate(&folder, &["six-position", ".", "--model-out", "nowhere/m.toml"]);
    assert!(called.code == 1 && called.stderr.contains("nowhere/m.toml: there is no such folder"), "{}", called.stderr);
}

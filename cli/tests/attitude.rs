//! `north align`, `north track` and `north import --block` on the command line: what is found, bridged, counted and refused.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::common::north;
use serde_json::Value;
use tempfile::TempDir;

/// A tenth of a second of a level block that stands at latitude 60° with its mark east: y points north and feels 7.5205335 °/h, z
/// 13.025946 °/h; gravity 9.82 m/s² up.
const STILL: [f64; 6] = [0.0, 0.752_053_35, 1.302_594_6, 0.0, 0.0, 9.82];
const HEAD: &str = "t_s,gx_arcsec,gy_arcsec,gz_arcsec,ax_m_s2,ay_m_s2,az_m_s2";

/// Rows of 0.1 s that end at these tenths.
fn rows(tenths: impl IntoIterator<Item = u32>, row: [f64; 6]) -> String {
    let mut text = String::new();
    for tenth in tenths {
        let [gx, gy, gz, ax, ay, az] = row;
        writeln!(text, "{},{gx},{gy},{gz},{ax},{ay},{az}", f64::from(tenth) / 10.0).unwrap();
    }
    text
}

fn recording(parts: &[String]) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("block.csv").display().to_string();
    fs::write(&path, format!("{HEAD}\n{}", parts.concat())).unwrap();
    (folder, path)
}

fn json(arguments: &[&str]) -> Value {
    let (code, stdout, stderr) = north(&[arguments, &["--json", "-"]].concat());
    assert_eq!(code, 0, "{stderr}");
    serde_json::from_str(&stdout).unwrap()
}

/// Refused with a reason that holds all of these.
fn refused(arguments: &[&str], parts: &[&str]) {
    let (code, stdout, stderr) = north(arguments);
    assert!(code == 1 && parts.iter().all(|part| stderr.contains(part)), "{code} {stdout} {stderr}");
}

fn track<'a>(path: &'a str, out: &'a str) -> Vec<&'a str> {
    vec!["track", path, "--latitude", "60", "--heading", "90", "--align", "10", "--class", "ring-laser", "--out", out]
}

/// The same with its track beside the recording.
fn tracked(parts: &[String], more: &[&str]) -> (Value, String) {
    let (folder, path) = recording(parts);
    let out = folder.path().join("track.csv").display().to_string();
    let value = json(&[&track(&path, &out)[..], more].concat());
    (value, fs::read_to_string(out).unwrap())
}

#[test]
fn a_still_block_is_aligned_and_its_page_written() {
    let (folder, path) = recording(&[rows(1..=1200, STILL)]);
    let page = folder.path().join("align.html");
    let report = page.display().to_string();
    let found = json(&["align", &path, "--latitude", "60", "--window", "30", "--reference", "90", "--report", &report]);
    assert!((found["heading_deg"].as_f64().unwrap() - 90.0).abs() < 1e-3, "{found}");
    assert!(found["sigma_heading_deg"].as_f64().unwrap() < 0.1, "{found}");
    // Four windows of 30 s, with the latitude and without it.
    assert_eq!(found["windows"].as_array().unwrap().len(), 8);
    let html = fs::read_to_string(page).unwrap();
    assert!(html.contains("inertial-least-squares") && html.contains("<svg") && !html.contains("<script"), "{html}");
    let blind = json(&["align", &path, "--latitude", "unknown"]);
    assert!((blind["latitude_deg"].as_f64().unwrap() - 60.0).abs() < 0.01, "{blind}");
}

#[test]
fn a_gap_separates_the_windows_of_an_alignment() {
    let (_folder, path) = recording(&[rows(1..=300, STILL), rows(340..=640, STILL)]);
    let found = json(&["align", &path, "--latitude", "60", "--window", "25"]);
    let mut starts: Vec<f64> =
        found["windows"].as_array().unwrap().iter().map(|window| window["start_s"].as_f64().unwrap()).collect();
    starts.dedup();
    assert_eq!(starts, [0.0, 34.0]);
}

#[test]
fn what_a_gap_leaves_of_an_alignment_is_said() {
    let (_folder, path) = recording(&[rows(1..=300, STILL), rows(340..=940, STILL)]);
    let found = json(&["align", &path, "--latitude", "60"]);
    let number = |value: &Value| value.as_f64().unwrap();
    let told = [&found["used_s"][0], &found["used_s"][1], &found["recording_s"]].map(number);
    let expected = [34.0, 94.0, 94.0];
    assert!(told.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6) && found["gaps"] == 1, "{found}");
    let (_, stdout, _) = north(&["align", &path, "--latitude", "60"]);
    let said = "1 gap; heading and levels are of the longest part without one, 34.0 to 94.0 s of 94.0 s\n";
    assert!(stdout.contains(said), "{stdout}");
}

#[test]
fn a_gap_that_shortens_the_alignment_of_a_track_is_said() {
    let parts = [rows(1..=50, STILL), rows(56..=600, STILL)];
    let (value, _) = tracked(&parts, &[]);
    assert!((value["aligned_s"].as_f64().unwrap() - 5.0).abs() < 1e-6, "{value}");
    assert_eq!(value["warnings"][0], "aligned over 5.0 s, not 10 s: no rows for 0.500 s before t_s = 5.6");
    let (folder, path) = recording(&parts);
    let out = folder.path().join("track.csv").display().to_string();
    let call = ["track", &path, "--latitude", "60", "--align", "30", "--class", "ring-laser", "--out", &out];
    let said = "a gap before t_s = 5.6 ends the alignment after 5.0 s; cut the recording there";
    refused(&call, &["block.csv", "too short", said]);
    let (value, _) = tracked(&[rows(1..=600, STILL)], &[]);
    assert!((value["aligned_s"].as_f64().unwrap() - 10.0).abs() < 1e-6, "{value}");
    assert_eq!(value["warnings"].as_array().unwrap().len(), 0);
}

#[test]
fn a_track_to_compare_with_has_rows_in_the_order_of_time_and_of_the_same_time() {
    let (folder, path) = recording(&[rows(1..=300, STILL)]);
    let file = |name: &str| folder.path().join(name).display().to_string();
    let (out, other) = (file("track.csv"), file("other.csv"));
    let call = [&track(&path, &out)[..], &["--reference-track", &other]].concat();
    for (text, said) in [
        ("t_s,heading_deg\n", "no data rows"),
        ("t_s,heading_deg\n7,90\n6,90\n", ", line 3, column 1 (t_s): time 6 is not later"),
        ("t_s,heading_deg,heading_deg\n7,90,91\n", ", line 1, column 3 (heading_deg)"),
    ] {
        fs::write(&other, text).unwrap();
        refused(&call, &["other.csv", said]);
    }
    fs::write(&other, "t_s,heading_deg\n1000,90\n1001,90\n").unwrap();
    let (code, _, stderr) = north(&call);
    let said = format!("no row of the track lies within the times of {other}, 1000.0 to 1001.0 s; the track: ");
    assert!(code == 0 && stderr.contains(&said), "{stderr}");
    fs::remove_file(&out).unwrap();
    fs::write(&other, "t_s,heading_deg\n0,90\n30,90\n").unwrap();
    let (code, _, stderr) = north(&call);
    assert_eq!((code, stderr.as_str()), (0, ""));
}

#[test]
fn what_cannot_be_aligned_is_refused_with_its_reason() {
    let (_folder, path) = recording(&[rows(1..=600, STILL)]);
    refused(&["align", &path, "--latitude", "89.5"], &["block.csv", "pole"]);
    let (_folder, short) = recording(&[rows(1..=50, STILL)]);
    refused(&["align", &short, "--latitude", "60"], &["too short"]);
    let (_folder, dead) = recording(&[rows(1..=600, [0.0, 0.0, 0.0, 0.0, 0.0, 9.82])]);
    refused(&["align", &dead, "--latitude", "60"], &["Earth rate not detected above the noise"]);
    let (_folder, falling) = recording(&[rows(1..=600, [0.0, 0.7, 1.3, 0.0, 0.0, 1.0])]);
    refused(&["align", &falling, "--latitude", "60"], &["m/s2"]);
}

/// z feels Ω sin 60° = +13.03 °/h: −60° has −13.03, and 45° has 10.64 horizontally instead of 7.52.
#[test]
fn a_latitude_that_the_rates_contradict_is_refused_with_theirs() {
    let (folder, path) = recording(&[rows(1..=600, STILL)]);
    let out = folder.path().join("track.csv").display().to_string();
    for latitude in ["-60", "45"] {
        let (found, given) = ("at latitude +60.00° ± ", format!("not at the given {latitude}°; correct --latitude"));
        refused(&["align", &path, "--latitude", latitude], &["block.csv", found, &given]);
        let track = ["track", &path, "--latitude", latitude, "--align", "30", "--class", "ring-laser", "--out", &out];
        // White noise of 0.002 °/√h is 0.022 °/h in 30 s; with a bias of 0.01 °/h it is 0.024 °/h, 0.09° of 15.04.
        let said = format!("+60.00° ± 0.09°, not at the given {latitude}°; correct --latitude");
        refused(&track, &["block.csv", &said]);
        refused(&[&track[..], &["--heading", "90"]].concat(), &["block.csv", &said]);
    }
}

#[test]
fn bad_files_are_refused_with_file_line_column_and_value() {
    for command in ["align", "track"] {
        let (folder, path) = recording(&[rows(1..=20, STILL), "1.5,0,0,0,0,0,9.82\n".into()]);
        let out = folder.path().join("track.csv").display().to_string();
        let call = |path: &str, parts: &[&str]| {
            let tail: &[&str] = if command == "track" { &["--out", &out] } else { &[] };
            refused(&[&[command, path, "--latitude", "60"], tail].concat(), parts);
        };
        // The header is line 1, so the row after twenty is line 22.
        call(&path, &["block.csv, line 22, column 1 (t_s)", "1.5"]);
        let (_nan_folder, nan) = recording(&[rows(1..=20, STILL), "2.1,0,nan,0,0,0,9.82\n".into()]);
        call(&nan, &["line 22, column 3 (gy_arcsec)", "nan", "a finite number"]);
        let other = folder.path().join("columns.csv").display().to_string();
        fs::write(&other, "t_s,gx_arcsec,gy_arcsec\n0.1,0,0\n").unwrap();
        call(&other, &["columns.csv, line 1", "`gz_arcsec` is missing"]);
        for (twice, place) in [("gx_arcsec", "column 8 (gx_arcsec)"), ("turn_deg,turn_deg", "column 9 (turn_deg)")] {
            fs::write(&other, format!("{HEAD},{twice}\n")).unwrap();
            call(&other, &["columns.csv, line 1", place, "appears twice"]);
        }
        call("nowhere.csv", &["nowhere.csv"]);
    }
}

/// Rows of 0.1 s with noise of the gyros, ± 0.02″, and of the accelerometers, ± 0.01 m/s², uniform by the golden ratio; `absurd` stands
/// in one row, counted from 0, and one column, counted from 0.
fn noisy(tenths: u32, absurd: Option<(u32, usize, f64)>) -> String {
    let mut text = String::new();
    for tenth in 1..=tenths {
        let uniform = |axis: usize| (f64::from(tenth) * 0.618_033_988_75 + axis as f64 * 0.377).fract() - 0.5;
        let mut row: [f64; 6] =
            std::array::from_fn(|axis| STILL[axis] + uniform(axis) * if axis < 3 { 0.04 } else { 0.02 });
        if let Some((place, axis, value)) = absurd.filter(|(place, ..)| place + 1 == tenth) {
            assert!(place < tenths);
            row[axis] = value;
        }
        let [gx, gy, gz, ax, ay, az] = row;
        writeln!(text, "{},{gx},{gy},{gz},{ax},{ay},{az}", f64::from(tenth) / 10.0).unwrap();
    }
    text
}

#[test]
fn no_single_absurd_sample_moves_an_alignment_or_a_track_beyond_its_sigma() {
    let aligned = |absurd| {
        let (_folder, path) = recording(&[noisy(1000, absurd)]);
        json(&["align", &path, "--latitude", "60", "--arw", "0.002", "--bias", "0"])
    };
    let held = |absurd| {
        let (folder, path) = recording(&[noisy(1000, absurd)]);
        let out = folder.path().join("track.csv").display().to_string();
        json(&["track", &path, "--latitude", "60", "--align", "60", "--class", "ring-laser", "--out", &out])
    };
    let number = |value: &Value, name: &str| value[name].as_f64().unwrap();
    let (of_align, of_track) = (aligned(None), held(None));
    assert!(of_align["outliers"]["rows"] == 0 && of_track["outliers"]["rows"] == 0, "{of_align} {of_track}");
    // The recording's ends, the aligned seconds, their end and what is tracked; every size and sign.
    for place in [0, 1, 300, 599, 600, 800, 999] {
        for (axis, value) in [(2, 1e3), (0, -1e3), (1, 1e6), (2, -1e6), (2, 1e20), (3, 1e3), (4, -1e6), (5, 1e20)] {
            let absurd = Some((place, axis, value));
            for (found, without) in [(aligned(absurd), &of_align), (held(absurd), &of_track)] {
                let moved = (number(&found, "heading_deg") - number(without, "heading_deg")).abs();
                let (sigma, before) = (number(&found, "sigma_heading_deg"), number(without, "sigma_heading_deg"));
                assert!(moved < 0.5 * before && sigma < 1.5 * before, "{absurd:?}: {moved} {found}");
                assert_eq!(found["outliers"]["rows"], 1, "{absurd:?}");
            }
        }
    }
}

/// A block that is turned by 1000″ within 0.1 s while it is aligned is felt by its accelerometers: it is no outlier, and the heading
/// follows it (z up: to the left, the heading becomes less).
#[test]
fn a_shock_is_followed_and_no_outlier() {
    let aligned = |shock: bool| {
        let shocked = noisy(1000, None).lines().enumerate().fold(String::new(), |mut text, (place, row)| {
            let mut fields: Vec<f64> = row.split(',').map(|field| field.parse().unwrap()).collect();
            // It is kicked, and caught again.
            if shock && place == 500 {
                (fields[3], fields[4]) = (fields[3] + 1000.0, 5.0);
            } else if shock && place == 501 {
                fields[4] = -5.0;
            }
            let fields: Vec<String> = fields.iter().map(f64::to_string).collect();
            writeln!(text, "{}", fields.join(",")).unwrap();
            text
        });
        let (_folder, path) = recording(&[shocked]);
        json(&["align", &path, "--latitude", "60", "--arw", "0.002", "--bias", "0"])
    };
    let (shocked, calm) = (aligned(true), aligned(false));
    assert_eq!(shocked["outliers"]["rows"], 0);
    let turned_deg = shocked["heading_deg"].as_f64().unwrap() - calm["heading_deg"].as_f64().unwrap();
    let sigma_deg = shocked["sigma_heading_deg"].as_f64().unwrap();
    assert!((turned_deg + 1000.0 / 3600.0).abs() < 2.0 * sigma_deg && sigma_deg < 1.0, "{turned_deg} {shocked}");
}

#[test]
fn a_result_never_takes_the_place_of_the_recording() {
    let (_folder, path) = recording(&[rows(1..=600, STILL)]);
    let before = fs::read_to_string(&path).unwrap();
    let said = ["block.csv: this file is read by the same command"];
    refused(&["align", &path, "--latitude", "60", "--report", &path, "--force"], &said);
    refused(&[&track(&path, &path)[..], &["--force"]].concat(), &said);
    assert_eq!(fs::read_to_string(&path).unwrap(), before);
}

#[test]
fn rows_that_no_gyro_measures_are_refused_by_name() {
    let (folder, path) =
        recording(&[rows(1..=300, STILL), rows(301..=330, [0.0, 0.0, 1e9, 0.0, 0.0, 9.82]), rows(331..=600, STILL)]);
    let out = folder.path().join("track.csv").display().to_string();
    refused(&["align", &path, "--latitude", "60"], &["block.csv", "30.1", "gz_arcsec", "1e9"]);
    refused(&track(&path, &out), &["block.csv", "30.1", "gz_arcsec", "1e9"]);
}

#[test]
fn a_recording_that_the_alignment_takes_whole_is_refused() {
    let (folder, path) = recording(&[rows(1..=600, STILL)]);
    let out = folder.path().join("track.csv").display().to_string();
    for heading in [&[][..], &["--heading", "90"]] {
        let call = ["track", &path, "--latitude", "60", "--align", "100", "--class", "ring-laser", "--out", &out];
        refused(&[&call[..], heading].concat(), &["60.0 s", "100 s", "nothing is left to track"]);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn a_still_block_is_held_with_its_sigma_and_its_innovations() {
    let (value, track) = tracked(&[rows(1..=1200, STILL)], &["--reference", "90"]);
    assert_eq!(
        (value["gaps"].as_u64(), value["saturated"].as_u64(), value["moving_s"].as_u64()),
        (Some(0), Some(0), Some(0))
    );
    assert!(value["rms_error_deg"].as_f64().unwrap() < 0.01, "{value}");
    assert!(value["nis_degrees_of_freedom"].as_u64().unwrap() > 300, "{value}");
    // A row a second after the first ten, a sigma in each.
    assert_eq!(track.lines().count(), 111);
    let header: Vec<&str> = track.lines().next().unwrap().split(',').collect();
    assert_eq!(header[..5], ["t_s", "heading_deg", "pitch_deg", "roll_deg", "sigma_heading_deg"]);
    for line in track.lines().skip(1) {
        let sigma: f64 = line.split(',').nth(4).unwrap().parse().unwrap();
        assert!(sigma > 0.0 && sigma < 0.05, "{line}");
    }
}

#[test]
fn gaps_are_bridged_with_a_wider_sigma_or_refused() {
    let (value, track) = tracked(&[rows(1..=300, STILL), rows(321..=600, STILL)], &[]);
    assert_eq!(value["gaps"].as_u64(), Some(1));
    let sigmas: Vec<f64> = track.lines().skip(1).map(|line| line.split(',').nth(4).unwrap().parse().unwrap()).collect();
    assert!(sigmas.last() > sigmas.first(), "{sigmas:?}");
    let (folder, path) = recording(&[rows(1..=300, STILL), rows(401..=600, STILL)]);
    let out = folder.path().join("track.csv").display().to_string();
    refused(&self::track(&path, &out), &["block.csv", "no rows for 10.0", "t_s = 40.1"]);
}

#[test]
fn a_saturated_gyro_is_counted_and_a_new_fix_wanted() {
    // 500 °/s over a tenth of a second is 180 000″; the block's range is 400 °/s.
    let fast = [0.0, 0.0, 180_000.0, 0.0, 0.0, 9.82];
    let (value, _) = tracked(&[rows(1..=300, STILL), rows(301..=303, fast), rows(304..=600, STILL)], &[]);
    assert_eq!(value["saturated"].as_u64(), Some(3));
    assert!(
        value["refix_at_s"].as_f64().unwrap() < 32.0 && value["sigma_heading_deg"].as_f64().unwrap() > 10.0,
        "{value}"
    );
}

#[test]
fn nothing_is_held_near_a_pole() {
    let (folder, path) = recording(&[rows(1..=300, STILL)]);
    let out = folder.path().join("track.csv").display().to_string();
    refused(&["track", &path, "--latitude", "-89.7", "--heading", "0", "--out", &out], &["pole"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn the_page_of_a_track_shows_heading_sigma_error_and_innovations() {
    let (folder, path) = recording(&[rows(1..=1200, STILL)]);
    let file = |name: &str| folder.path().join(name).display().to_string();
    let (out, page) = (file("track.csv"), file("track.html"));
    json(&[&track(&path, &out)[..], &["--reference", "90", "--report", &page]].concat());
    let html = fs::read_to_string(page).unwrap();
    for part in ["heading, °", "sigma, °", "error, °", "NIS", "95 % of such means"] {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("NaN") && !html.contains("<script"));
}

/// Counts of 0.1″ and 0.0125 g, x to the right, y forward: a block that points north at latitude 60° feels 7.5 °/h along y.
#[test]
fn a_foreign_triad_becomes_a_recording_of_a_block() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let map = "format = 1\nlatitude_deg = 60\n[time]\ninterval_s = 0.1\n[gyro]\ncolumns = [1, 2, 3]\n\
               axes = [\"right\", \"forward\", \"up\"]\nunit = \"arcsec\"\nscale = 0.1\n[accelerometer]\ncolumns = [4, 5, 6]\n\
               axes = [\"right\", \"forward\", \"up\"]\nunit = \"g\"\nscale = 0.0125\n[index]\nangles_deg = [0, 90, 180, 270]\ndwell_s = 10\n";
    fs::write(file("map.toml"), map).unwrap();
    fs::write(file("counts.csv"), format!("a,b,c,d,e,f\n{}", "2,75,130,0,0,80\n".repeat(20))).unwrap();
    let (map, counts, block) = (file("map.toml"), file("counts.csv"), file("block.csv"));
    let call = ["import", "--map", &map, &counts, "--block", &block];
    let (code, stdout, stderr) = north(&call);
    assert_eq!(code, 0, "{stderr}");
    assert!(stdout.contains("block.csv: recording of a block from 20 samples, 0 lost, 0 not valid"), "{stdout}");
    let text = fs::read_to_string(&block).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines[0], lines.len()), (HEAD, 21));
    let row: Vec<f64> = lines[1].split(',').map(|field| field.parse().unwrap()).collect();
    // Forward 7.5″, left −0.2″, up 13″; 80 counts are 1 g.
    let expected = [0.1, 7.5, -0.2, 13.0, 0.0, 0.0, 9.80665];
    assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{row:?}");
    // It is never overwritten.
    refused(&call, &["block.csv"]);
}

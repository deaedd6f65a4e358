//! `north track` with aiding on the command line: readings taken at their own times, outliers, lost sources, bad input.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::common::north;
use serde_json::Value;
use tempfile::TempDir;

const HEAD: &str = "t_s,gx_arcsec,gy_arcsec,gz_arcsec,ax_m_s2,ay_m_s2,az_m_s2";
/// A tenth of a second of a level block that stands at 60° north, 30° east with its mark east: y feels 7.5205335 °/h, z 13.025946 °/h;
/// normal gravity at 60° is 9.81918 m/s² (WGS 84).
const STILL: &str = "0,0.75205335,1.3025946,0,0,9.81918";

struct Ship(TempDir);

impl Ship {
    /// A block that stands for so long; a row for which `change` has something has that.
    fn new(seconds: u32, change: impl Fn(u32) -> Option<String>) -> Self {
        let mut text = format!("{HEAD}\n");
        for tenth in 1..=10 * seconds {
            let row = change(tenth).unwrap_or_else(|| format!("{},{STILL}", f64::from(tenth) / 10.0));
            if !row.is_empty() {
                writeln!(text, "{row}").unwrap();
            }
        }
        let ship = Self(tempfile::tempdir().unwrap());
        ship.write("block.csv", &text);
        ship
    }

    fn still(seconds: u32) -> Self {
        Self::new(seconds, |_| None)
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    /// Satellites of a ship that stands, and its heading, from 1 s to so many; `change` as in [`Self::new`].
    fn satellites(&self, seconds: u32, change: impl Fn(u32) -> Option<&'static str>) -> String {
        let mut text = "t_s,ve_m_s,vn_m_s,vu_m_s,lat_deg,lon_deg,height_m\n".to_owned();
        for second in 1..=seconds {
            writeln!(text, "{second},{}", change(second).unwrap_or("0,0,0,60,30,0")).unwrap();
        }
        self.write("satellites.csv", &text)
    }

    fn headings(&self, seconds: u32) -> String {
        let rows: String = (1..=seconds).map(|second| format!("{second},90,0.3\n")).collect();
        self.write("heading.csv", &format!("t_s,heading_deg,sigma_heading_deg\n{rows}"))
    }

    fn call(&self, more: &[&str]) -> (i32, String, String) {
        let (block, out) = (self.path("block.csv"), self.path("track.csv"));
        let usual = [
            "track",
            &block,
            "--latitude",
            "60",
            "--heading",
            "91",
            "--heading-sigma",
            "2",
            "--align",
            "5",
            "--out",
            &out,
            "--force",
        ];
        north(&[&usual[..], &["--class", "source-fog"], more].concat())
    }

    fn json(&self, more: &[&str]) -> Value {
        let (code, stdout, stderr) = self.call(&[more, &["--json", "-"]].concat());
        assert_eq!(code, 0, "{stderr}");
        serde_json::from_str(&stdout).unwrap()
    }

    fn refused(&self, more: &[&str], parts: &[&str]) {
        let (code, stdout, stderr) = self.call(more);
        assert!(code == 1 && parts.iter().all(|part| stderr.contains(part)), "{code} {stdout} {stderr}");
    }
}

fn source<'a>(summary: &'a Value, name: &str) -> &'a Value {
    let sources = summary["sources"].as_array().unwrap();
    sources.iter().find(|source| source["source"] == name).unwrap_or_else(|| panic!("{name}: {summary}"))
}

/// Submerged the satellites are not used; aided they are. Levelling takes 5 s, and of 6 to 60 s there are 55 positions.
#[test]
fn a_mode_holds_from_its_time_on() {
    let ship = Ship::still(60);
    let satellites = ship.satellites(60, |_| None);
    for (mode, ignored) in [("submerged@1e9", 0), ("submerged@30", 30), ("submerged", 55)] {
        let summary = ship.json(&["--aid", &satellites, "--mode", mode]);
        let position = source(&summary, "position");
        let told = position["ignored_by_mode"].as_u64().unwrap();
        assert!(told.abs_diff(ignored) <= 1, "{mode}: {summary}");
        assert_eq!(position["taken"].as_u64().unwrap() + told, 55, "{mode}: {summary}");
        assert_eq!(summary["warnings"].as_array().unwrap().len(), 0, "{summary}");
    }
}

#[test]
fn a_source_of_which_most_is_rejected_is_a_warning() {
    let ship = Ship::still(60);
    // From 20 s on the positions are a degree of longitude, 55 km, away.
    let satellites = ship.satellites(60, |second| (second >= 20).then_some("0,0,0,60,31,0"));
    let (code, stdout, stderr) = ship.call(&["--aid", &satellites]);
    let said = "north: warning: position: 41 of 55 readings were rejected, 41 in a row from 20.0 s on";
    assert!(code == 0 && stderr.contains(said) && stdout.contains("(the sigmas do not hold"), "{stdout} {stderr}");
}

#[test]
fn a_source_of_another_time_is_a_warning() {
    let ship = Ship::still(20);
    let headings = ship.write("heading.csv", "t_s,heading_deg\n1007,90\n1008,90\n");
    let (code, stdout, stderr) = ship.call(&["--aid", &headings]);
    let said = "north: warning: no reading of heading lies within the tracked part of the recording, 5.0 to 20.0 s";
    assert!(code == 0 && stderr.contains(said) && !stdout.contains("do not hold"), "{stdout} {stderr}");
}

#[test]
fn readings_are_taken_and_the_page_shows_them() {
    let ship = Ship::still(120);
    let (satellites, headings) = (ship.satellites(120, |_| None), ship.headings(120));
    let page = ship.path("track.html");
    let summary = ship.json(&["--aid", &satellites, "--aid", &headings, "--reference", "90", "--report", &page]);
    assert!((summary["heading_deg"].as_f64().unwrap() - 90.0).abs() < 0.05, "{summary}");
    // 115 readings of 0.3° are 0.028°, and the gyros wander by 0.105 °/√h: 0.019° in 2 min.
    assert!((0.02..0.06).contains(&summary["sigma_heading_deg"].as_f64().unwrap()), "{summary}");
    // The first five seconds level the block.
    assert_eq!(source(&summary, "heading")["taken"], 115);
    assert_eq!(
        (source(&summary, "velocity")["taken"].as_u64(), source(&summary, "position")["unused"].as_u64()),
        (Some(115), Some(5))
    );
    let track = fs::read_to_string(ship.path("track.csv")).unwrap();
    assert!(
        track.starts_with(
            "t_s,heading_deg,pitch_deg,roll_deg,sigma_heading_deg,sigma_level_deg,lat_deg,lon_deg,height_m,"
        )
    );
    assert_eq!(track.lines().count(), 116);
    let sigma = |line: &str| line.split(',').nth(4).unwrap().parse::<f64>().unwrap();
    assert!(track.lines().skip(1).all(|line| sigma(line) > 0.0));
    let html = fs::read_to_string(page).unwrap();
    for part in ["sigma, °", "error, °", "NIS, velocity", "NIS, heading", "95 % of such means"] {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("NaN") && !html.contains("<script"));
    // The track is what another one is compared with.
    let track = ship.path("first.csv");
    fs::rename(ship.path("track.csv"), &track).unwrap();
    let again = ship.json(&["--aid", &satellites, "--aid", &headings, "--reference-track", &track]);
    assert_eq!(again["rms_error_deg"].as_f64(), Some(0.0));
}

#[test]
fn columns_of_the_recording_aid_too() {
    let ship = Ship::still(60);
    let text = fs::read_to_string(ship.path("block.csv")).unwrap();
    // A heading each second, in the row that ends there: every tenth field has something.
    let with = |(number, line): (usize, &str)| match number {
        0 => format!("{line},heading_deg\n"),
        n if n % 10 == 0 => format!("{line},90\n"),
        _ => format!("{line},\n"),
    };
    ship.write("block.csv", &text.lines().enumerate().map(with).collect::<String>());
    let summary = ship.json(&[]);
    assert_eq!(source(&summary, "heading")["taken"], 55, "{summary}");
}

/// A ship that turns by 6 °/s to the right: a reading between two rows is worth what the heading then was. In a twentieth of a second
/// it turns by 0.3°, ten sigmas of these readings.
#[test]
fn a_reading_belongs_to_its_own_time() {
    // Right is negative about z: −6 °/s · 0.1 s = −2160″.
    let ship = Ship::new(40, |tenth| {
        (tenth > 100).then(|| format!("{},0,0,{},0,0,9.81918", f64::from(tenth) / 10.0, -2160.0 + 1.3025946))
    });
    let rows: String = (11..40)
        .map(|second| format!("{}.05,{},0.03\n", second, 90.0 + 6.0 * (f64::from(second) + 0.05 - 10.0)))
        .collect();
    let headings = ship.write("heading.csv", &format!("t_s,heading_deg,sigma_heading_deg\n{rows}"));
    let summary = ship.json(&["--aid", &headings]);
    assert_eq!(
        (source(&summary, "heading")["taken"].as_u64(), source(&summary, "heading")["rejected"].as_u64()),
        (Some(29), Some(0))
    );
    assert!(source(&summary, "heading")["nis"].as_f64().unwrap() < 1.0, "{summary}");
}

#[test]
fn an_outlier_is_rejected_with_its_place_and_reason() {
    let ship = Ship::still(60);
    let satellites = ship.satellites(60, |second| (second == 40).then_some("0,0,0,60.02,30,0"));
    let summary = ship.json(&["--aid", &satellites]);
    assert_eq!(source(&summary, "position")["rejected"], 1);
    assert_eq!(source(&summary, "velocity")["rejected"], 0);
    let rejection = &summary["rejections"][0];
    // 0.02° are 2.2 km, of 5 m and what is known after 35 readings.
    assert!(rejection["place"].as_str().unwrap().ends_with("satellites.csv, line 41"), "{rejection}");
    assert!(rejection["reason"].as_str().unwrap().contains("sigmas from what was expected"), "{rejection}");
    let (_, stdout, _) = ship.call(&["--aid", &satellites]);
    assert!(stdout.contains("position: 54 taken, 1 rejected beyond 5 sigma"), "{stdout}");
}

#[test]
fn a_lost_source_is_told_and_sigma_grows() {
    let ship = Ship::still(300);
    let (satellites, headings) = (ship.satellites(300, |_| None), ship.headings(100));
    let summary = ship.json(&["--aid", &satellites, "--aid", &headings]);
    let lost = &source(&summary, "heading")["lost"][0];
    assert_eq!((lost["from_s"].as_f64(), lost["to_s"].as_f64()), (Some(100.0), None));
    let sigma = |name: &str| lost[name].as_f64().unwrap();
    assert!(sigma("sigma_heading_after_deg") > 1.5 * sigma("sigma_heading_before_deg"), "{lost}");
    assert_eq!(source(&summary, "velocity")["lost"].as_array().unwrap().len(), 0);
    // What the mode does not take is counted.
    let summary = ship.json(&["--aid", &satellites, "--aid", &headings, "--mode", "aided", "--mode", "log-only@200"]);
    assert!(source(&summary, "velocity")["ignored_by_mode"].as_u64().unwrap() >= 99, "{summary}");
}

#[test]
fn gaps_and_saturated_gyros_are_bridged_and_counted_or_refused() {
    let gap = |seconds: f64| {
        Ship::new(60, move |tenth| (300..300 + (10.0 * seconds) as u32).contains(&tenth).then(String::new))
    };
    let ship = gap(0.5);
    let headings = ship.headings(60);
    assert_eq!(ship.json(&["--aid", &headings])["gaps"], 1);
    let ship = gap(3.0);
    let headings = ship.headings(60);
    ship.refused(&["--aid", &headings], &["block.csv", "t_s = 33", "no rows for 3.000 s", "align again"]);
    // A shock: 200 °/s over a tenth of a second are 72 000″; the block's range is 150 °/s.
    let ship = Ship::new(60, |tenth| (tenth == 400).then(|| "40,0,0,72000,5,0,9.81918".to_owned()));
    let headings = ship.headings(39);
    let summary = ship.json(&["--aid", &headings]);
    assert!(summary["saturated"] == 1 && summary["sigma_heading_deg"].as_f64().unwrap() > 10.0, "{summary}");
}

#[test]
fn bad_input_is_refused_with_file_line_field_and_value() {
    let ship = Ship::still(20);
    let bad = |name: &str, text: &str, parts: &[&str]| {
        let file = ship.write(name, text);
        ship.refused(&["--aid", &file], &[&[name], parts].concat());
    };
    bad("back.csv", "t_s,depth_m\n7,1\n6.5,1\n", &["line 3, column 1 (t_s)", "6.5", "7"]);
    bad("text.csv", "t_s,depth_m\n7,deep\n", &["line 2, column 2 (depth_m)", "deep", "a finite number"]);
    bad("far.csv", "t_s,lat_deg,lon_deg,height_m\n7,95,30,0\n", &["line 2, column 2 (lat_deg)", "95", "-90 to 90"]);
    bad("half.csv", "t_s,lat_deg,height_m\n7,60,0\n", &["line 1", "`lon_deg` is missing"]);
    bad(
        "empty-field.csv",
        "t_s,lat_deg,lon_deg,height_m\n7,60,,0\n",
        &["line 2, column 3 (lon_deg)", "a finite number"],
    );
    bad("sigma.csv", "t_s,heading_deg,sigma_heading_deg\n7,90,0\n", &["line 2, column 3 (sigma_heading_deg)", "\"0\""]);
    bad("ragged.csv", "t_s,depth_m\n7\n", &["line 2", "1 fields"]);
    bad("twice.csv", "t_s,depth_m,depth_m\n7,1,2\n", &["line 1, column 3 (depth_m)", "twice", "column 2"]);
    bad("sigmas.csv", "t_s,depth_m,sigma_depth_m,sigma_depth_m\n", &["line 1, column 4 (sigma_depth_m)", "twice"]);
    bad("no-rows.csv", "t_s,depth_m\n", &["no line of it holds a reading"]);
    bad("no-readings.csv", "t_s,depth_m\n7,\n8,\n", &["no line of it holds a reading"]);
    bad("other.csv", "t_s,speed\n7,1\n", &["speed", "columns of a reading"]);
    bad("time.csv", "depth_m\n1\n", &["`t_s` is missing"]);
    bad("void.csv", "", &["empty"]);
    bad("elsewhere.csv", "t_s,lat_deg,lon_deg,height_m\n7,50,30,0\n", &["line 2", "50°", "60°"]);
    bad("baseline.csv", "t_s,baseline_heading_deg\n7,90\n", &["line 2", "baseline_m", "--installation"]);
    bad("rotor.csv", "t_s,esg_x,esg_y,esg_z,esg_sensor\n7,0,0,1,4\n", &["line 2", "[electrostatic_gyro]"]);
    ship.refused(&["--aid", "nowhere.csv"], &["nowhere.csv"]);
    let depth = ship.write("depth.csv", "t_s,depth_m\n7,0\n");
    let installation = ship.write("installation.toml", "antenna_m = [0, 0, 5]\nmast_m = 3\n");
    ship.refused(&["--aid", &depth, "--installation", &installation], &["installation.toml, line 2", "mast_m"]);
    let installation = ship.write("negative.toml", "wavelength_m = -0.19\n");
    ship.refused(&["--aid", &depth, "--installation", &installation], &["negative.toml, line 1", "-0.19"]);
    let (block, out) = (ship.path("block.csv"), ship.path("polar.csv"));
    let polar = ["track", &block, "--latitude", "89.5", "--heading", "0", "--aid", &depth, "--out", &out];
    let (code, _, stderr) = north(&polar);
    assert!(code == 1 && stderr.contains("pole") && !Path::new(&out).exists(), "{stderr}");
    for usage in [&["--aid", &depth, "--mode", "flying"][..], &["--mode", "aided"]] {
        assert_eq!(ship.call(usage).0, 2);
    }
}

/// Voyages out of the project's own simulator, by the command that it prints: errors of the heading within four of their sigmas, in
/// 95 % of the seconds within 1.96 (correlated in time, so that only 80 % are asked for).
#[test]
fn simulated_voyages_are_tracked_by_the_command_that_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    for voyage in ["coast", "dive"] {
        let out = folder.path().join(voyage).display().to_string();
        let (code, command, stderr) = north(&["simulate", "--voyage", voyage, "--out", &out]);
        assert_eq!(code, 0, "{stderr}");
        let words: Vec<&str> = command.split_whitespace().filter(|word| *word != "\\").skip(1).collect();
        let (code, stdout, stderr) = north(&[&words[..], &["--json", "-"]].concat());
        assert_eq!(code, 0, "{stderr}");
        let summary: Value = serde_json::from_str(&stdout).unwrap();
        assert!(summary["rms_error_deg"].as_f64().unwrap() < 0.2, "{summary}");
        assert!(summary["within_two_sigma"].as_f64().unwrap() > 0.8, "{summary}");
        if voyage == "coast" {
            assert!(source(&summary, "position")["rejected"].as_u64().unwrap() > 5, "{summary}");
            let lost = &source(&summary, "velocity")["lost"][0];
            assert_eq!((lost["from_s"].as_f64(), lost["to_s"].as_f64()), (Some(1200.0), Some(1501.0)));
        } else {
            assert!(source(&summary, "electrostatic gyro")["taken"].as_u64().unwrap() > 50, "{summary}");
            assert!(summary["sigma_heading_deg"].as_f64().unwrap() < 0.1, "{summary}");
        }
        // A folder with something in it is not overwritten.
        assert_eq!(north(&["simulate", "--voyage", voyage, "--out", &out]).0, 1);
    }
}

//! Imports: the measured campaign from the recording it was made of, every unit and frame by hand, every error with its
//! place.

use std::fs;
use std::path::{Path, PathBuf};

use north::campaign::{Campaign, Role, Row, RunReader};
use north::failure::Failure;
use north::import::{Format, Map, Summary, block, import};
use north_finder::sensing::level::Specific;
use tempfile::TempDir;

const SIMPLE: &str = r#"
format = 1
latitude_deg = 60
[time]
interval_s = 0.5
[gyro]
columns = ["w"]
unit = "deg/h"
[index]
column = "angle"
"#;

/// Imports a recording that is given as bytes; errors without the folder's name.
fn bring(map: &str, recording: &[u8], format: Format) -> Result<(TempDir, Summary), String> {
    bring_with(import, map, recording, format)
}

/// The same as a recording of a block.
fn bring_block(map: &str, recording: &[u8], format: Format) -> Result<Summary, String> {
    bring_with(block, map, recording, format).map(|(_, summary)| summary)
}

/// Either way to import.
type Way = fn(&Map, &Path, Format, &Path, &mut dyn FnMut(u64) -> bool) -> Result<Summary, Failure>;

fn bring_with(way: Way, map: &str, recording: &[u8], format: Format) -> Result<(TempDir, Summary), String> {
    let folder = tempfile::tempdir().unwrap();
    let [map_path, file, out] = ["map.toml", "recording", "out"].map(|name| folder.path().join(name));
    fs::write(&map_path, map).unwrap();
    fs::write(&file, recording).unwrap();
    let without_folder = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
    let map = Map::read(&map_path).map_err(|error| without_folder(error.to_string()))?;
    match way(&map, &file, format, &out, &mut |_| true) {
        Ok(summary) => Ok((folder, summary)),
        Err(failure) => {
            assert!(!out.exists(), "nothing is left after an error");
            Err(without_folder(failure.to_string()))
        }
    }
}

fn text(map: &str, recording: &str) -> Result<(TempDir, Summary), String> {
    bring(map, recording.as_bytes(), Format::Text)
}

fn refusal(map: &str, recording: &str) -> String {
    text(map, recording).map(|(_, summary)| summary).unwrap_err()
}

fn rows(folder: &Path, run: usize) -> Vec<Row> {
    RunReader::open(&folder.join(format!("out/runs/{run:03}.csv"))).unwrap().collect::<Result<_, _>>().unwrap()
}

fn map_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("maps").join(name)
}

/// The measured data, if this machine has them.
fn data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("NORTH_FINDER_DATA").map_or_else(beside, PathBuf::from);
    if !folder.is_dir() {
        eprintln!("skipped: no measured data (NORTH_FINDER_DATA)");
        return None;
    }
    Some(folder)
}

#[test]
fn the_measured_campaign_comes_out_of_the_recording_it_was_made_of() {
    let Some(data) = data() else { return };
    let counts = fs::read_to_string(data.join("ring-laser-triad/increments_100hz.csv")).unwrap();
    // The published file: its own head, then the same rows with blanks.
    let head = fs::read_to_string(data.join("ring-laser-triad/lasergyro-first-lines.imu")).unwrap();
    let head: String =
        head.lines().take_while(|line| *line != "0 0 2 0 0 80").flat_map(|line| [line, "\r\n"]).collect();
    let published = head + &counts.split_once('\n').unwrap().1.replace(',', " ");
    let expected = Campaign::read(&data.join("parked-vehicle")).unwrap();
    for (map, recording) in [("psins-counts-csv.toml", &counts), ("psins-lasergyro.toml", &published)] {
        // The mapping keeps every sample, the campaign has rows of 20.
        let map = fs::read_to_string(map_file(map)).unwrap();
        assert!(map.contains("samples_per_row = 1 "));
        let (folder, summary) = text(&map.replace("samples_per_row = 1 ", "samples_per_row = 20 "), recording).unwrap();
        assert_eq!(summary.doubts, Vec::<String>::new());
        let campaign = Campaign::read(&folder.path().join("out")).unwrap();
        assert_eq!(Campaign { folder: expected.folder.clone(), ..campaign }, expected);
        for (i, run) in expected.runs.iter().enumerate() {
            let found = rows(folder.path(), i + 1);
            let printed: Vec<Row> = RunReader::open(&expected.path_of(run)).unwrap().collect::<Result<_, _>>().unwrap();
            assert_eq!(found.len(), printed.len());
            for (a, b) in found.iter().zip(&printed) {
                assert_eq!((a.t_s, a.index_deg, a.fog_arcsec, a.level), (b.t_s, b.index_deg, b.fog_arcsec, b.level));
            }
        }
    }
}

#[test]
fn a_single_gyro_with_everything_that_text_can_be() {
    // Clockwise encoder of 16384 counts, 0.01 °/s for 10 ms, 300.15 K, 5 mg to the right.
    let mut recording = String::from("time;rate;acc_n;acc_e;t_coil;encoder;u_batt;x;field\r\nms;deg/s;;;K;;V;;\r\n");
    for i in 0..33_000 {
        if i == 200 {
            recording.push_str("\r\n# a comment\r\n");
        }
        if !(5000..5003).contains(&i) {
            recording.push_str(&format!("{},0;0,01;2,0;\"5,0\";300,15;4096;12,5;-;{}\r\n", 7000 + 10 * i, i % 2));
        }
    }
    let (folder, summary) = text(&fs::read_to_string(map_file("indexed-gyro.toml")).unwrap(), &recording).unwrap();
    assert_eq!((summary.samples, summary.losses.lost_samples, summary.runs.len()), (33_000, 3, 2));
    assert!((summary.measured_rate_hz.unwrap() - 100.0).abs() < 1e-6);
    let first = rows(folder.path(), 1);
    assert_eq!(first.len(), 30_000 - 3);
    let row = &first[0];
    assert_eq!(
        (row.t_s, row.index_deg, row.level),
        (0.01, 12.5 - 90.0, Some(Specific { forward: 0.002, left: -0.005 }))
    );
    assert!((row.fog_arcsec - 0.36).abs() < 1e-9 && (row.temp_c.unwrap() - 27.0).abs() < 1e-9, "{row:?}");
    assert_eq!(first[1].extra, [12.5, 0.01]);
    // The row after the gap spans it, with the missing increments made up for, and counted.
    let gap = &first[5000];
    assert_eq!(gap.lost_frames, 3);
    assert!((gap.interval_s - 0.04).abs() < 1e-9 && (gap.fog_arcsec - 4.0 * 0.36).abs() < 1e-9, "{gap:?}");
    let campaign = Campaign::read(&folder.path().join("out")).unwrap();
    assert_eq!((campaign.runs[0].role, campaign.runs[0].reference_azimuth_deg), (Role::Fit, Some(181.25)));
    assert_eq!(rows(folder.path(), 2).len(), 1000);
}

#[test]
fn a_triad_is_read_along_the_virtual_index() {
    // Forward 1, left 2 arcsec a sample; dwells of 1 s at 0, 90, 45 and -90 degrees; rows of 3 samples.
    let map = r#"
        format = 1
        latitude_deg = 30
        samples_per_row = 3
        [text]
        header_rows = 0
        delimiter = "whitespace"
        [time]
        rate_hz = 4
        [gyro]
        columns = [3, 1, 2]
        axes = ["left", "up", "forward"]
        unit = "arcsec"
        [index]
        angles_deg = [0, 90, 45, -90]
        dwell_s = 1
    "#;
    let (folder, summary) = text(map, &"\t7   1 2\n".repeat(35)).unwrap();
    // 35 samples are two runs of 16 and three samples that are no run.
    assert_eq!(summary.runs.len(), 2);
    assert_eq!(fs::read_dir(folder.path().join("out/runs")).unwrap().count(), 2);
    let found: Vec<_> = rows(folder.path(), 2).iter().map(|row| (row.t_s, row.index_deg, row.fog_arcsec)).collect();
    let diagonal = 3.0 / 2f64.sqrt();
    let expected = [
        (0.75, 0.0, 3.0),
        (1.0, 0.0, 1.0),
        (1.75, 90.0, 6.0),
        (2.0, 90.0, 2.0),
        (2.75, 45.0, 3.0 * diagonal),
        (3.0, 45.0, diagonal),
        (3.75, -90.0, -6.0),
        (4.0, -90.0, -2.0),
    ];
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!((found.0, found.1), (expected.0, expected.1));
        assert!((found.2 - expected.2).abs() < 1e-10, "{found:?}");
    }
    // 7 arcsec in a quarter of a second are 28 °/h about the vertical.
    assert!(summary.doubts[0].contains("deg/h"), "{:?}", summary.doubts);
}

/// A log at `rate_hz`: the Earth's rate at 30° north, forward to the north, as delta angles in radians.
fn kvh_log(samples: u32, rate_hz: f64, damage: impl Fn(u32) -> u8) -> Vec<u8> {
    let radians = |deg_h: f64| (deg_h / rate_hz / 206_264.806_247) as f32;
    let mut log = Vec::new();
    for i in 0..samples {
        let angles = [radians(15.041067 * 0.75f64.sqrt()), 0.0, -radians(7.5205335)];
        let mut frame = hal_sim::frames::kvh_a(angles, [0.0, 0.01, -1.0], 0x77, (i % 128) as u8, 25);
        match damage(i) {
            0 => {}
            1 => continue,
            2 => frame[9] ^= 4,
            _ => frame = hal_sim::frames::kvh_a(angles, [0.0, 0.01, -1.0], 0x75, (i % 128) as u8, 25),
        }
        log.extend(frame);
    }
    log
}

#[test]
fn kvh_logs_count_what_they_lack() {
    let map =
        fs::read_to_string(map_file("kvh-triad.toml")).unwrap().replace("latitude_deg = 34.75", "latitude_deg = 30");
    let log = kvh_log(240_500, 1000.0, |i| match i {
        100..=104 => 1,
        700 | 5000 => 2,
        9000 => 3,
        _ => 0,
    });
    let (folder, summary) = bring(&map, &log, Format::Kvh).unwrap();
    let losses = summary.losses;
    assert_eq!((losses.lost_samples, losses.bad_frames, losses.invalid_samples, losses.skipped_bytes), (7, 2, 1, 72));
    let rows = rows(folder.path(), 1);
    assert_eq!(rows.iter().map(|row| u64::from(row.lost_frames)).sum::<u64>(), 8);
    let north = 15.041067 * 0.75f64.sqrt();
    for row in &rows {
        let expected = north * row.index_deg.to_radians().cos();
        assert!((row.fog_arcsec / row.interval_s - expected).abs() < 1e-4, "{row:?}");
        assert_eq!(row.temp_c, Some(25.0));
        assert!((row.level.unwrap().left + 0.01).abs() < 1e-6, "right is minus left");
    }
    assert_eq!(summary.doubts.len(), 1, "only the clock: {:?}", summary.doubts);
}

#[test]
fn a_gyro_at_962_hz_is_found_out() {
    let map = fs::read_to_string(map_file("kvh-triad.toml")).unwrap();
    let seconds = 250.0;
    let map = map.replace("# duration_s = 612.4", &format!("duration_s = {seconds}"));
    let error = bring(&map, &kvh_log((962.0 * seconds) as u32, 962.0, |_| 0), Format::Kvh).map(|it| it.1).unwrap_err();
    assert!(error.contains("962.000 Hz") && error.contains("declared are 1000.000 Hz"), "{error}");
    let good = bring(&map, &kvh_log((1000.0 * seconds) as u32, 1000.0, |_| 0), Format::Kvh).unwrap().1;
    assert_eq!(good.measured_rate_hz, Some(1000.0));
}

#[test]
fn errors_of_the_recording_name_line_column_and_value() {
    for (recording, error) in [
        (
            "w,angle\n1,0\n2,0\nx,0\n",
            r#"recording, line 4, column 1 (w): "x" is not allowed; allowed is a finite decimal number"#,
        ),
        (
            "w,angle\n1,0\n2,nan\n",
            r#"recording, line 3, column 2 (angle): "nan" is not allowed; allowed is a finite decimal number"#,
        ),
        ("w,angle\n1,0\n\n#\n2\n", "recording, line 5: 1 fields; the first record has 2"),
        ("w,angle\n", "recording: no data rows follow the header"),
        ("", "recording: the file is empty"),
        ("\n", "recording: no data rows follow the header"),
        (
            "v,angle\n1,2\n",
            r#"map.toml, line 7, column 12: "column \"w\"" is not allowed; allowed is a number, or one of v, angle"#,
        ),
        (
            "w,w,angle\n1,2,3\n",
            r#"map.toml, line 7, column 12: "column \"w\"" is not allowed; allowed is a name that stands once in the header, or the column's number"#,
        ),
    ] {
        assert_eq!(refusal(SIMPLE, recording), error);
    }
    let timed = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\nunit = \"ms\"");
    assert_eq!(
        refusal(&timed, "t,w,angle\n5,1,0\n6,1,0\n6,1,0\n"),
        r#"recording, line 4, column 1 (t): "0.006 s" is not allowed; allowed is later than the sample before, 0.006 s, by at most 1e9 s"#
    );
    let error = bring(SIMPLE, &[0; 200_000], Format::Text).map(|it| it.1).unwrap_err();
    assert!(error.contains("not a text recording"), "{error}");
    let kvh = SIMPLE.replace("\"w\"", "1").replace("\"angle\"", "2");
    assert_eq!(
        bring(&kvh, b"no frames here", Format::Kvh).map(|it| it.1).unwrap_err(),
        "recording: no frame of KVH format A in 14 bytes, 0 check sums wrong"
    );
}

#[test]
fn errors_of_the_mapping_name_their_place() {
    for (from, to, error) in [
        (
            "latitude_deg = 60",
            "latitude_deg = 91",
            r#"map.toml, line 3, column 16: "latitude_deg = 91" is not allowed"#,
        ),
        (
            "unit = \"deg/h\"",
            "unit = \"furlong\"",
            "map.toml, line 8, column 8: `gyro.unit`: unknown variant `furlong`, expected one of",
        ),
        ("interval_s = 0.5", "", "map.toml, line 4, column 1: [time] needs a column"),
        ("interval_s = 0.5", "interval_s = 0", r#"map.toml, line 5, column 14: "interval_s = 0.0" is not allowed"#),
        (
            "[\"w\"]",
            "[\"w\", 2]",
            r#"map.toml, line 6, column 1: "2 gyro columns" is not allowed; allowed is 1, or the 3"#,
        ),
        ("[\"w\"]", "[1, 2, 3]", "map.toml, line 6, column 1: a triad needs axes"),
        ("column = \"angle\"", "dwell_s = 2", "map.toml, line 9, column 1: the index of a single gyro is measured"),
        ("[index]", "[text]\ndelimiter = \"ab\"\n[index]", r#"map.toml, line 10, column 13: "delimiter = \"ab\"""#),
        ("[index]", "[[run]]\nrepeat = 2\n[index]", "map.toml, line 9, column 1: a run that is repeated needs every_s"),
        ("[index]", "[[run]]\nend = 2\n[index]", "map.toml, line 10, column 1: unknown field `end`"),
    ] {
        assert!(SIMPLE.contains(from));
        let found = refusal(&SIMPLE.replace(from, to), "w,angle\n1,0\n");
        assert!(found.starts_with(error), "{found}");
    }
    let left_handed = SIMPLE.replace("[\"w\"]", "[1, 2, 3]\naxes = [\"forward\", \"right\", \"up\"]");
    let error = refusal(&left_handed, "w,angle\n1,0\n");
    assert!(error.contains("left-handed") && error.contains("in `columns` and in `axes` alike"), "{error}");
}

#[test]
fn runs_must_lie_within_the_recording_and_training_apart_from_check() {
    let recording = format!("w,angle\n{}", "1,0\n".repeat(20));
    let with_runs = |runs: &str| format!("{SIMPLE}{runs}");
    let error = refusal(&with_runs("[[run]]\nstart_s = 2\nseconds = 9\n"), &recording);
    assert_eq!(error, "map.toml, line 11, column 1: recording ends after 10.000 s; this run goes from 2 s to 11 s");
    let two = "[[run]]\nrole = \"fit\"\nseconds = 6\n[[run]]\nstart_s = 5\nseconds = 2\n";
    let error = refusal(&with_runs(two), &recording);
    assert!(error.contains("line 14, column 1: a run to learn from and a run to judge by must not overlap"), "{error}");
    let (folder, summary) = text(&with_runs(&two.replace("role = \"fit\"\n", "")), &recording).unwrap();
    assert_eq!((rows(folder.path(), 1).len(), rows(folder.path(), 2).len()), (12, 4));
    assert!(summary.notes.iter().any(|note| note.contains("overlap")), "{:?}", summary.notes);
    let (folder, summary) = text(&with_runs("[[run]]\nstart_s = 1\nseconds = 2\nevery_s = 3\n"), &recording).unwrap();
    assert_eq!(summary.runs.iter().map(|run| run.start_s).collect::<Vec<_>>(), [1.0, 4.0, 7.0]);
    assert_eq!(rows(folder.path(), 3).len(), 4);
}

#[test]
fn a_recording_ends_where_the_mapping_says() {
    let recording = "w,angle\n1,0\n2,0\n3,0\n4,0\nSum,10\nsigned by,me\n";
    let arcsec = |keys: &str| {
        let (folder, _) = text(&format!("{SIMPLE}[text]\n{keys}\n"), recording).unwrap();
        rows(folder.path(), 1).iter().map(|row| row.fog_arcsec).collect::<Vec<_>>()
    };
    // 1 °/h for 0.5 s is 0.5 arcsec.
    assert_eq!(arcsec("footer_rows = 2"), [0.5, 1.0, 1.5, 2.0]);
    assert_eq!(arcsec("stop_at = \"Sum\""), [0.5, 1.0, 1.5, 2.0]);
    assert_eq!(arcsec("rows = 3"), [0.5, 1.0, 1.5]);
    let error = refusal(SIMPLE, recording);
    assert_eq!(error, r#"recording, line 6, column 1 (w): "Sum" is not allowed; allowed is a finite decimal number"#);
    assert!(refusal(&format!("{SIMPLE}[text]\nfooter_rows = 6\n"), recording).contains("no data rows"));
}

#[test]
fn several_columns_add_up_to_a_time() {
    let map = SIMPLE.replace("interval_s = 0.5", "columns = [\"h\", \"m\", \"s\"]\nunits = [\"h\", \"min\", \"s\"]");
    let recording = "h,m,s,w,angle\n9,59,59,1,0\n10,0,0.5,1,0\n10,0,2,1,0\n";
    let (folder, _) = text(&map, recording).unwrap();
    let rows = rows(folder.path(), 1);
    assert_eq!(rows.iter().map(|row| row.t_s).collect::<Vec<_>>(), [1.5, 3.0]);
    let error = refusal(&map.replace("\"min\", ", ""), recording);
    assert!(error.starts_with("map.toml, line 5, column 11: time is one column"), "{error}");
}

#[test]
fn files_of_positions_are_joined_into_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (name, rates) in [("a.csv", "w\n1\n2\n"), ("b.csv", "w\n3\n"), ("c.csv", "w\n4\n5\n6\n")] {
        fs::write(at(name), rates).unwrap();
    }
    let map = "format = 1\nlatitude_deg = 60\n[time]\ninterval_s = 0.5\n[gyro]\ncolumns = [\"w\"]\nunit = \"deg/h\"\n\
               [[run]]\nrole = \"fit\"\npositions = [{ file = \"a.csv\", index_deg = 0 }, { file = \"b.csv\", index_deg = 90 }]\n\
               [[run]]\npositions = [{ file = \"c.csv\", index_deg = 180 }]\n";
    fs::write(at("map.toml"), map).unwrap();
    let read = |text: &str| {
        fs::write(at("map.toml"), text).unwrap();
        let map = Map::read(&at("map.toml")).map_err(|error| error.to_string())?;
        import(&map, folder.path(), Format::Text, &at("out"), &mut |_| true).map_err(|error| error.to_string())
    };
    let missing = read(&map.replace("c.csv", "d.csv")).unwrap_err();
    assert!(missing.contains("d.csv: No such file") && !at("out").exists(), "{missing}");
    let error = read(&map.replace("[[run]]\npositions", "[[run]]\nseconds = 2\npositions")).unwrap_err();
    assert!(error.contains("a run made of files holds them whole"), "{error}");
    let summary = read(map).unwrap();
    assert_eq!(summary.samples, 6);
    let first: Vec<_> = rows(folder.path(), 1).iter().map(|row| (row.t_s, row.index_deg, row.fog_arcsec)).collect();
    assert_eq!(first, [(0.5, 0.0, 0.5), (1.0, 0.0, 1.0), (1.5, 90.0, 1.5)]);
    assert_eq!(rows(folder.path(), 2).len(), 3);
}

#[test]
fn binary_files_are_refused_by_name() {
    for (head, what) in [
        (&b"MATLAB 5.0 MAT-file, Platform: GLNXA64\0\0"[..], "a MATLAB file"),
        (b"\x89HDF\r\n\x1a\n", "an HDF5"),
        (b"PK\x03\x04....", "a zip archive"),
        (b"\x1f\x8b\x08", "a gzip archive"),
        (b"000001D GRA51  BHZIU\x07\xe4\0\0", "a miniSEED file"),
        (b"MS\x03\x04\0\0", "a miniSEED file"),
        (b"1,2\n\0\0", "a binary file"),
    ] {
        let error = bring(SIMPLE, head, Format::Text).map(|(_, summary)| summary).unwrap_err();
        assert!(error.starts_with(&format!("recording: this is {what}")), "{error}");
        assert!(error.chars().all(|character| !character.is_control()), "{error}");
    }
}

#[test]
fn numbers_that_make_no_sense_are_refused() {
    for (from, to, error) in [
        ("interval_s = 0.5", "interval_s = 1e308", "line 5, column 14: \"interval_s = 1e308\""),
        ("column = \"angle\"", "column = \"angle\"\nscale = nan", "\"scale = NaN, offset_deg = 0\""),
        ("column = \"angle\"", "column = \"angle\"\noffset_deg = inf", "\"scale = 1, offset_deg = inf\""),
        ("[index]", "[temperature]\ncolumn = 1\nscale = inf\n[index]", "\"scale = inf, offset = 0\""),
        ("[index]", "[[channel]]\nname = \"x\"\ncolumn = 1\noffset = nan\n[index]", "\"scale = 1, offset = NaN\""),
        ("unit = \"deg/h\"", "unit = \"deg/h\"\nscale = inf", "\"scale = inf\""),
        (
            "unit = \"deg/h\"",
            "unit = \"rad\"\nscale = 1e308",
            "recording, line 2, column 1 (w): \"1.0, which becomes inf with its unit, scale and offset\"",
        ),
        (
            "column = \"angle\"",
            "column = \"angle\"\noffset_deg = 1e308",
            "recording, line 2, column 2 (angle): \"0.0, which becomes 1e308",
        ),
    ] {
        let found = refusal(&SIMPLE.replace(from, to), "w,angle\n1,0\n");
        assert!(found.contains(error), "{found}");
    }
    let stamps = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\ninterval_s = 0.5");
    let error = refusal(&stamps, "t,w,angle\n0.5,1,0\n1,1,0\n1e308,1,0\n");
    assert!(error.starts_with("recording, line 4, column 1 (t): \"1e308 s\" is not allowed"), "{error}");
    let stamped = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\nduration_s = 20");
    let error = refusal(&stamped, "t,w,angle\n0,1,0\n5,1,0\n10,1,0\n");
    assert!(error.contains("the time stamps span 10.000 s, duration_s says 20 s"), "{error}");
}

#[test]
fn a_proposed_mapping_imports_what_it_was_proposed_for() {
    // A triad at rest at 30° north, forward east: gyro (0, h, Ω sin φ) in rad/s, gravity in m/s², time in ms.
    let (h, up) = (7.292e-5 * 30_f64.to_radians().cos(), 7.292e-5 * 0.5);
    let rows: String =
        (0..200).map(|i| format!("{};{};{};{};0.0;0.0;9.81\n", 10 * i, "0.0", h, up).replace('.', ",")).collect();
    let recording = format!("time_ms;gyr_x;gyr_y;gyr_z;acc_x;acc_y;acc_z\n{rows}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strange.csv");
    fs::write(&path, &recording).unwrap();
    let map = north::import::guess(&path, None).unwrap();
    for line in ["unit = \"rad/s\"", "unit = \"ms\"", "unit = \"m/s2\"", "latitude_deg = 30.00", "decimal_comma = true"]
    {
        assert!(map.contains(line), "{line}:\n{map}");
    }
    let (_, summary) = text(&map, &recording).unwrap();
    assert_eq!(summary.doubts, Vec::<String>::new());
    let error = north::import::guess(&map_file("kvh-triad.toml"), None).unwrap_err();
    assert!(error.to_string().contains("no rows of numbers"), "{error}");
}

#[test]
fn a_log_of_a_dead_gyro_says_so() {
    let map = fs::read_to_string(map_file("kvh-triad.toml")).unwrap();
    let error = bring(&map, &kvh_log(300_000, 1000.0, |_| 3), Format::Kvh).map(|it| it.1).unwrap_err();
    assert_eq!(error, "recording: each of its 300000 samples is marked as not valid by the sensor itself");
}

#[test]
fn a_log_without_a_frame_ends_soon() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("zeros.bin");
    // 10 GB of zeros, of which the disk holds none.
    fs::File::create(&path).unwrap().set_len(10_000_000_000).unwrap();
    let map = Map::read(&map_file("kvh-triad.toml")).unwrap();
    let begun = std::time::Instant::now();
    let error = import(&map, &path, Format::Kvh, &folder.path().join("out"), &mut |_| true).unwrap_err().to_string();
    assert!(error.contains("no frame of KVH format A in 16"), "{error}");
    assert!(begun.elapsed().as_secs() < 30);
}

#[test]
fn empty_lines_are_rows_of_a_header() {
    // As an editor counts them: a title, an empty line, the names, an empty line; comments do not count, nor what is empty below them.
    let map = format!("{SIMPLE}[text]\nheader_rows = 4\n");
    let (folder, _) = text(&map, "my log\n\n# a comment\n\nw,angle\n\n1,0\n\n2,0\n").unwrap();
    assert_eq!(rows(folder.path(), 1).iter().map(|row| row.fog_arcsec).collect::<Vec<_>>(), [0.5, 1.0]);
}

#[test]
fn a_file_in_several_runs_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.csv"), "w\n1\n2\n").unwrap();
    let read = |roles: [&str; 2]| {
        let map = format!(
            "format = 1\nlatitude_deg = 60\n[time]\ninterval_s = 0.5\n[gyro]\ncolumns = [\"w\"]\nunit = \"deg/h\"\n\
             [[run]]\nrole = {:?}\npositions = [{{ file = \"a.csv\", index_deg = 0 }}]\n\
             [[run]]\nrole = {:?}\npositions = [{{ file = \"./a.csv\", index_deg = 90 }}]\n",
            roles[0], roles[1]
        );
        fs::write(at("map.toml"), map).unwrap();
        let out = at(&format!("out-{}", roles[1]));
        import(&Map::read(&at("map.toml")).unwrap(), folder.path(), Format::Text, &out, &mut |_| true)
    };
    assert!(read(["fit", "fit"]).unwrap().notes[0].starts_with("./a.csv is in several runs"));
    let error = read(["fit", "check"]).unwrap_err().to_string();
    assert!(
        error.contains("line 11, column 1: a run to learn from and a run to judge by must not hold the same file"),
        "{error}"
    );
}

/// A triad at rest at 30° north, forward east, ten rows a second: gyro (0, h, Ω sin φ) and biases, in this unit.
fn triad(unit_of_rad_s: f64, bias: f64, rows: usize) -> String {
    let (h, up) = (7.292e-5 * 30_f64.to_radians().cos(), 7.292e-5 * 0.5);
    let row = |i: usize| {
        format!(
            "{:.1},{bias},{:e},{:e},0.0,0.0,9.81\n",
            i as f64 * 0.1,
            h * unit_of_rad_s + bias,
            up * unit_of_rad_s + bias
        )
    };
    (1..=rows).map(row).collect()
}

fn proposal(recording: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strange.csv");
    fs::write(&path, recording).unwrap();
    north::import::guess(&path, None).unwrap()
}

#[test]
fn a_proposal_has_runs_to_learn_from_and_runs_to_judge_by() {
    let recording = format!("t_s,gx,gy,gz,ax,ay,az\n{}", triad(1.0, 0.0, 9700));
    let map = proposal(&recording);
    // 970 s hold four runs of four dwells of a minute.
    let (folder, _) = text(&map, &recording).unwrap_or_else(|error| panic!("{error}\n{map}"));
    let campaign = Campaign::read(&folder.path().join("out")).unwrap();
    let roles: Vec<Role> = campaign.runs.iter().map(|run| run.role).collect();
    assert_eq!(roles, [Role::Fit, Role::Check, Role::Fit, Role::Check], "{map}");
}

#[test]
fn a_triad_of_large_biases_is_asked_for_its_unit() {
    for (unit_of_rad_s, name) in
        [(1.0, "rad/s"), (57.29578, "deg/s"), (57.29578 * 3600.0, "deg/h"), (20_626.48, "arcsec")]
    {
        let recording = |bias: f64| format!("t_s,gx,gy,gz,ax,ay,az\n{}", triad(unit_of_rad_s, bias, 100));
        assert!(proposal(&recording(0.0)).contains(&format!("unit = \"{name}\"")), "{name}");
    }
    // Half a degree a second is a bias that many have; no scale makes it the Earth's rate.
    let recording = format!("t_s,gx,gy,gz,ax,ay,az\n{}", triad(57.29578, 0.5, 100));
    let map = proposal(&recording);
    assert!(map.contains("unit = \"EDIT\"") && !map.contains("\nscale"), "{map}");
    let error = refusal(&map.replace("nan", "30"), &recording);
    assert!(
        error.contains("unknown variant `EDIT`, expected one of `arcsec`, `deg`, `rad`, `deg/h`, `deg/s`, `rad/s`"),
        "{error}"
    );
    // A name that says it is believed.
    let named = recording.replace("gx,gy,gz", "gx [deg/s],gy [deg/s],gz [deg/s]");
    assert!(proposal(&named).contains("unit = \"deg/s\""));
}

#[test]
fn no_column_is_proposed_for_two_things() {
    // Time and a gyro without names: no index, so it is a file of one position.
    let map = proposal(&(1..100).map(|i| format!("{i} 0.00{}\n", 4 + i % 2)).collect::<String>());
    assert!(map.contains("[time]\ncolumn = 1\n") && map.contains("[gyro]\ncolumns = [2]\n"), "{map}");
    assert!(
        map.contains("positions = [{ file = \"strange.csv\", index_deg = 0 }]") && !map.contains("[index]"),
        "{map}"
    );
    // With an index, whose swing of 9.7 is in deg/h (50° of latitude): four positions.
    let indexed = |i: usize| {
        let index = 90 * (i / 100);
        format!(
            "{i};{index}.00;{:.4}\n",
            3.0 + 9.668 * f64::from(index as u32).to_radians().cos() + 0.01 * (i % 3) as f64
        )
    };
    let recording: String = (1..400).map(indexed).collect();
    let map = proposal(&recording);
    assert!(map.contains("[time]\ncolumn = 1\n") && map.contains("[gyro]\ncolumns = [3]\nunit = \"deg/h\""), "{map}");
    assert!(map.contains("[index]\ncolumn = 2\n") && map.contains("role = \"fit\""), "{map}");
    let (folder, _) = text(&map.replace("nan", "50"), &recording).unwrap();
    assert_eq!(rows(folder.path(), 1).len(), 398);
    // Nothing that is known: everything is asked for.
    let map = proposal("a,b\n1,5\n3,4\n2,7\n");
    for line in ["latitude_deg = nan", "interval_s = 0 ", "columns = [\"EDIT\"]", "unit = \"EDIT\""] {
        assert!(map.contains(line), "{line}:\n{map}");
    }
}

#[test]
fn a_proposal_keeps_footers_and_units_out() {
    let recording =
        format!("log of today\n\nt,w,angle\ns,deg/h,deg\n{}\nSum,12\nsigned by,me\n", "1,2,3\n2,3,3\n3,1,3\n");
    let map = proposal(&recording);
    for line in ["header_rows = 4", "names_row = 3", "footer_rows = 2", "columns = [\"w\"]", "unit = \"deg/h\""] {
        assert!(map.contains(line), "{line}:\n{map}");
    }
    let (folder, _) = text(&map.replace("nan", "50"), &recording).unwrap();
    assert_eq!(rows(folder.path(), 1).len(), 2);
}

/// A triad at rest at 30° north, whose columns stand in this order; what is wrong with single lines is said by number, from 1.
fn in_order(header: &str, order: [usize; 7], wrong: &[(usize, &str)]) -> String {
    let rows = triad(1.0, 0.0, 600);
    let ordered = rows.lines().map(|row| {
        let fields: Vec<&str> = row.split(',').collect();
        order.map(|column| fields[column]).join(",")
    });
    let lines = std::iter::once(header.to_owned()).chain(ordered).zip(1..);
    let with_wrong = |(line, number): (String, usize)| match wrong.iter().find(|(at, _)| *at == number) {
        Some((_, wrong)) => format!("{wrong}\n"),
        None => line + "\n",
    };
    lines.map(with_wrong).collect()
}

#[test]
fn names_of_axes_decide_where_columns_point() {
    // Of the file's own columns t, gx, gy, gz, ax, ay, az. Forward is east: the Earth's rate is along left and up.
    let plain = in_order("time,gx,gy,gz,ax,ay,az", [0, 1, 2, 3, 4, 5, 6], &[]);
    let expected = text(&proposal(&plain), &plain).map(|(folder, _)| rows(folder.path(), 1)).unwrap();
    for (header, order, gyro) in [
        ("az,ay,ax,gz,gy,gx,time", [6, 5, 4, 3, 2, 1, 0], r#"["gx", "gy", "gz"]"#),
        (
            "time,Gyro_Z (rad/s),Gyro_X (rad/s),Gyro_Y (rad/s),acc_y,acc_x,acc_z",
            [0, 3, 1, 2, 5, 4, 6],
            r#"["Gyro_X (rad/s)", "Gyro_Y"#,
        ),
        (
            "time,pitch_rate,yaw_rate,roll_rate,ax,ay,az",
            [0, 2, 3, 1, 4, 5, 6],
            r#"["roll_rate", "pitch_rate", "yaw_rate"]"#,
        ),
    ] {
        let recording = in_order(header, order, &[]);
        let map = proposal(&recording);
        assert!(map.contains(&format!("columns = {gyro}")), "{map}");
        assert_eq!(map.matches("axes = [\"forward\", \"left\", \"up\"]").count(), 2, "{map}");
        let (folder, _) = text(&map, &recording).unwrap();
        assert_eq!(rows(folder.path(), 1), expected, "{header}");
    }
    // x stands upright: y is then forward and z left, wherever their columns are.
    let map = proposal(&in_order("time,gz,gx,gy,az,ax,ay", [0, 2, 3, 1, 5, 6, 4], &[]));
    assert!(
        map.contains("columns = [\"gx\", \"gy\", \"gz\"]") && map.contains("[\"up\", \"forward\", \"left\"]"),
        "{map}"
    );
    // Names that are no axes leave the columns as they stand.
    let map = proposal(&in_order("time,gyro1,gyro2,gyro3,acc1,acc2,acc3", [0, 1, 2, 3, 4, 5, 6], &[]));
    assert!(
        map.contains("columns = [\"gyro1\", \"gyro2\", \"gyro3\"]") && map.contains("EDIT: a guess, only"),
        "{map}"
    );
}

#[test]
fn bad_rows_are_named_and_do_not_end_the_recording() {
    let bad = [(72, "7.1,0,nan,0,0,0,9.81"), (100, "9.9,0,0"), (300, "x")];
    let recording = in_order("time,gx,gy,gz,ax,ay,az", [0, 1, 2, 3, 4, 5, 6], &bad);
    let map = proposal(&recording);
    assert!(map.contains("from its first 597 rows"), "{map}");
    assert!(
        map.contains("stops at line 72 (\"nan\"), line 100 (3 fields, not 7), line 300 (1 fields, not 7):"),
        "{map}"
    );
    // A minute, less the row that sets the clock, is four dwells of a quarter; no row is lost in silence.
    assert!(map.contains("dwell_s = 14.9") && !map.contains("footer_rows"), "{map}");
    let error = refusal(&map, &recording);
    assert_eq!(error, r#"recording, line 72, column 3 (gy): "nan" is not allowed; allowed is a finite decimal number"#);
}

#[test]
fn what_lies_beyond_the_runs_is_said() {
    let recording = format!("w,angle\n{}", "1,0\n".repeat(100));
    let (_, summary) = text(&format!("{SIMPLE}[[run]]\nseconds = 10\n"), &recording).unwrap();
    // Twenty rows of half a second, and the one that is beyond: line 22. 79 of 100 rows follow, 4 bytes each of 408.
    let [note] = &summary.notes[..] else { panic!("{:?}", summary.notes) };
    assert!(
        note.contains("recording, line 22: the last run ends here") && note.contains("77.5 % of the file"),
        "{note}"
    );
    assert_eq!(text(SIMPLE, &recording).unwrap().1.notes, Vec::<String>::new());
}

#[test]
fn a_proposal_of_a_file_with_a_byte_order_mark_is_imported() {
    let rows = triad(1.0, 0.0, 600).replace('\n', "\r\n");
    let recording = format!("\u{feff}time,gx,gy,gz,ax,ay,az\r\ns,rad/s,rad/s,rad/s,m/s^2,m/s^2,m/s^2\r\n{rows}END\r\n");
    let map = proposal(&recording);
    for line in ["column = \"time\"\n", "names_row = 1 ", "footer_rows = 1 "] {
        assert!(map.contains(line), "{line}:\n{map}");
    }
    assert!(!map.contains("import stops"), "{map}");
    // Four dwells of 14.9 s, ten rows a second.
    assert_eq!(text(&map, &recording).unwrap().1.runs[0].rows, 596);
}

#[test]
fn dates_with_times_are_time_stamps() {
    let recording: String = (0..600)
        .map(|i| format!("2026-05-04T09:{:02}:{:02}.5Z,0,0.000063,0.000036,0,0,9.81\n", 58 + i / 60, i % 60))
        .map(|row| row.replace("09:60", "10:00").replace("09:61", "10:01"))
        .take(240)
        .collect();
    let recording = format!("utc,gx,gy,gz,ax,ay,az\n{recording}");
    let map = proposal(&recording);
    assert!(map.contains("column = \"utc\"\nunit = \"iso8601\""), "{map}");
    let (folder, summary) = text(&map, &recording).unwrap();
    // Rows of a second, also over the full hour.
    assert!(
        rows(folder.path(), 1).iter().all(|row| row.interval_s == 1.0) && summary.runs[0].rows > 200,
        "{summary:?}"
    );
    let error = refusal(&map, &recording.replace("09:59:10.5Z", "yesterday"));
    assert!(
        error.contains("line 72, column 1 (utc): \"2026-05-04Tyesterday\"") && error.contains("ISO 8601"),
        "{error}"
    );
}

#[test]
fn what_is_no_foreign_text_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |bytes: &[u8]| {
        let path = folder.path().join("file");
        fs::write(&path, bytes).unwrap();
        north::import::guess(&path, None).unwrap_err().to_string()
    };
    let run = refused(b"t_s,index_deg,fog_arcsec,ax_g\n1,0,3,0\n2,0,4,0\n");
    assert!(run.contains("this is a run (docs/formats.md)") && run.contains("needs no import"), "{run}");
    assert!(refused(b"").ends_with("file: the file is empty"));
    for json in ["{\"a\": [1, 2, 3]}", "[\n  {\"gx\": 1}\n]", "[[1, 2]]"] {
        assert!(refused(json.as_bytes()).contains("this is a JSON file"), "{json}");
    }
    assert!(refused(b"[a heading]\nand words\n").contains("no rows of numbers"));
    let text = "time,gx\n1,2\n3,4\n";
    for bytes in [
        text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>(),
        text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
        "\u{feff}t".encode_utf16().flat_map(u16::to_le_bytes).collect(),
    ] {
        let error = refused(&bytes);
        assert!(error.contains("UTF-16 text: convert it to UTF-8"), "{error}");
    }
    assert!(refused(&[0; 1000]).contains("a binary file"));
}

#[test]
fn times_in_milliseconds_are_told_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let run = |step: f64| -> String {
        let rows = (1..=800).map(|i| format!("{},0,{}\n", step * f64::from(i), f64::from(i % 7)));
        "t_s,index_deg,fog_arcsec\n".to_owned() + &rows.collect::<String>()
    };
    let path = folder.path().join("a.csv");
    let read = |step: f64| {
        fs::write(&path, run(step)).unwrap();
        RunReader::open(&path)
            .and_then(Iterator::collect::<Result<Vec<_>, _>>)
            .map(|rows| rows.len())
            .map_err(|error| error.to_string())
    };
    assert_eq!((read(1.0), read(60.0)), (Ok(800), Ok(800)));
    let error = read(1000.0).unwrap_err();
    assert!(
        error.contains("line 4, column 1 (t_s): \"rows 1000 s apart\"") && error.contains("may be milliseconds"),
        "{error}"
    );
    assert!(
        read(1000.0).is_err()
            && north::characterise::read(&path).unwrap_err().to_string().contains("may be milliseconds")
    );
    fs::write(&path, "t_s,gx_arcsec,gy_arcsec,gz_arcsec,ax_m_s2,ay_m_s2,az_m_s2\n10,0,0,0,0,0,9\n20,0,0,0,0,0,9\n")
        .unwrap();
    let error = north::block_csv::read(&path).unwrap_err().to_string();
    assert!(error.contains("\"rows 10 s apart\" is not allowed"), "{error}");
    // Rows of 400 Hz for five minutes: too near to an honest log to be refused, but doubted.
    let stamped = SIMPLE.replace("interval_s = 0.5", "column = \"t_s\"");
    let recording: String = (1..=120_000).map(|i| format!("{},1,0\n", 2.5 * f64::from(i))).collect();
    let (_, summary) = text(&stamped, &format!("t_s,w,angle\n{recording}")).unwrap();
    assert!(summary.doubts[0].contains("2.5 s apart for 3.5 days"), "{:?}", summary.doubts);
}

/// A triad at rest at 30° north, forward east, at 100 Hz: arcsec and m/s².
const BLOCK: &str = r#"
format = 1
latitude_deg = 30
[time]
rate_hz = 100
[gyro]
columns = [1, 2, 3]
axes = ["forward", "left", "up"]
unit = "arcsec"
[accelerometer]
columns = [4, 5, 6]
axes = ["forward", "left", "up"]
unit = "m/s2"
[index]
angles_deg = [0, 90]
dwell_s = 0.5
"#;

/// Increments of 0.01 s, arcsec: 15.041067 °/h · cos 30° to the north, which is left, and · sin 30° upwards.
const BLOCK_ROW: &str = "0,0.13026,0.0752,0,0,9.81\n";

#[test]
fn a_block_is_checked_as_a_campaign_is() {
    let recording = format!("a,b,c,d,e,f\n{}", BLOCK_ROW.repeat(200));
    let read = |map: &str| bring_block(map, recording.as_bytes(), Format::Text);
    let timed = |seconds: &str| BLOCK.replace("rate_hz = 100", &format!("rate_hz = 100\nduration_s = {seconds}"));
    let good = read(&timed("2")).unwrap();
    assert_eq!((good.samples, good.measured_rate_hz, good.doubts.len()), (200, Some(100.0), 0), "{:?}", good.doubts);
    let error = read(&timed("3")).unwrap_err();
    assert!(
        error.starts_with("recording: samples came at 66.667 Hz (200 in 3.000 s), declared are 100.000 Hz"),
        "{error}"
    );
    let wrong_units = BLOCK.replace("\"arcsec\"", "\"deg/s\"").replace("\"m/s2\"", "\"g\"");
    let doubts = read(&wrong_units).unwrap().doubts;
    let [rate, gravity] = &doubts[..] else { panic!("{doubts:?}") };
    assert!(rate.contains("the triad's mean rate is"), "{rate}");
    assert!(gravity.contains("the accelerometers' mean is 9.8100 g"), "{gravity}");
}

#[test]
fn a_block_without_a_sample_is_refused() {
    let map = fs::read_to_string(map_file("kvh-triad.toml")).unwrap();
    let error = bring_block(&map, &kvh_log(1000, 1000.0, |_| 3), Format::Kvh).unwrap_err();
    assert_eq!(error, "recording: each of its 1000 samples is marked as not valid by the sensor itself");
    // Without a declared interval the only row sets the clock.
    let stamped = BLOCK.replace("rate_hz = 100", "column = 7");
    let recording = format!("a,b,c,d,e,f,t\n{}", BLOCK_ROW.replace('\n', ",1\n"));
    let error = bring_block(&stamped, recording.as_bytes(), Format::Text).unwrap_err();
    assert_eq!(error, "recording: no data rows follow the header");
}

/// Rows of 1 °/h at these times, milliseconds.
fn stamped_rows(times_ms: impl IntoIterator<Item = u32>) -> String {
    let row = |time_ms: u32| format!("{time_ms},1,0\n");
    format!("t,w,angle\n{}", times_ms.into_iter().map(row).collect::<String>())
}

#[test]
fn late_time_stamps_are_no_lost_samples() {
    let declared = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\nunit = \"ms\"\nrate_hz = 100");
    // Every 300th stamp is 7 ms late: a step of 17 ms, and one of 3 ms.
    let late = stamped_rows((1..=3000).map(|i| 10 * i + if i % 300 == 150 { 7 } else { 0 }));
    assert_eq!(
        refusal(&declared, &late),
        "recording: 10 time stamps lie closer than half a sample to the one before, and 10 samples seem lost by longer \
         steps: these are times of arrival; leave out `column` and give rate_hz with duration_s, or leave out rate_hz"
    );
    let counted = declared.replace("column = \"t\"\nunit = \"ms\"\n", "duration_s = 30\n");
    let stamped = declared.replace("rate_hz = 100", "");
    for map in [counted, stamped] {
        let (_, summary) = text(&map, &late).unwrap();
        assert_eq!((summary.losses.lost_samples, summary.doubts), (0, Vec::new()), "{map}");
    }
    // A gap of ten seconds among stamps of which every 50th is late: whatever the rate is, it is not to be declared.
    let jitter = (1..=1000).map(|i| 10 * i + if i % 50 == 25 { 7 } else { 0 });
    let error = refusal(&declared, &stamped_rows(jitter.chain((2001..=2010).map(|i| 10 * i))));
    assert!(error.contains("samples came at 100.995 Hz") && error.contains("leave out `column`"), "{error}");
    assert!(!error.contains("declare the rate"), "{error}");
    // Gaps without such steps are counted.
    let (_, summary) =
        text(&declared, &stamped_rows((1..=3000_u32).filter(|i| i % 300 != 150).map(|i| 10 * i))).unwrap();
    assert_eq!(summary.losses.lost_samples, 10);
}

#[test]
fn a_gap_that_nothing_counts_is_doubted() {
    let map = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\nunit = \"ms\"");
    let gap = || (0..1000).map(|i| 10 * i + if i < 500 { 0 } else { 100_000 });
    let expected = "recording, line 502: 100.010 s without a sample, where a step is 0.110 s in the mean; with rate_hz in \
                    [time] what is missing is counted";
    let doubts = text(&map, &stamped_rows(gap())).unwrap().1.doubts;
    assert!(doubts.len() == 1 && doubts[0].ends_with(expected), "{doubts:?}");
    assert_eq!(text(&map, &stamped_rows((0..1000).map(|i| 10 * i))).unwrap().1.doubts, Vec::<String>::new());
    let declared = map.replace("\"ms\"", "\"ms\"\nrate_hz = 100");
    let (_, summary) = text(&declared, &stamped_rows(gap())).unwrap();
    assert_eq!((summary.losses.lost_samples, summary.doubts), (10_000, Vec::new()));
    // The same of a block.
    let stamped = BLOCK.replace("rate_hz = 100", "column = 7\nunit = \"ms\"");
    let rows: String = gap().map(|time_ms| BLOCK_ROW.replace('\n', &format!(",{time_ms}\n"))).collect();
    let doubts = bring_block(&stamped, format!("a,b,c,d,e,f,t\n{rows}").as_bytes(), Format::Text).unwrap().doubts;
    assert!(doubts.iter().any(|doubt| doubt.ends_with(expected)), "{doubts:?}");
}

#[test]
fn a_gap_in_the_file_of_a_position_is_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.csv"), stamped_rows((0..100).map(|i| 10 * i))).unwrap();
    fs::write(at("b.csv"), stamped_rows((0..100).map(|i| 10 * i + if i < 50 { 0 } else { 1000 }))).unwrap();
    let map = "format = 1\nlatitude_deg = 60\n[time]\ncolumn = \"t\"\nunit = \"ms\"\n[gyro]\ncolumns = [\"w\"]\n\
               unit = \"deg/h\"\n[[run]]\npositions = [{ file = \"a.csv\", index_deg = 0 }, { file = \"b.csv\", index_deg = 90 }]\n";
    fs::write(at("map.toml"), map).unwrap();
    let map = Map::read(&at("map.toml")).unwrap();
    let doubts = import(&map, folder.path(), Format::Text, &at("out"), &mut |_| true).unwrap().doubts;
    let [doubt] = &doubts[..] else { panic!("{doubts:?}") };
    assert!(doubt.contains("b.csv, line 52: 1.010 s without a sample, where a step is 0.020 s"), "{doubt}");
}

#[test]
fn a_run_that_begins_in_a_gap_lacks_only_its_own_samples() {
    let map = SIMPLE.replace("interval_s = 0.5", "column = \"t\"\nunit = \"ms\"\nrate_hz = 10");
    let recording = stamped_rows((1..=200).chain(301..=400).map(|i| 100 * i));
    let (folder, summary) = text(&format!("{map}[[run]]\nstart_s = 25\nseconds = 10\n"), &recording).unwrap();
    assert_eq!(summary.losses.lost_samples, 100);
    let rows = rows(folder.path(), 1);
    // From 25 s to 30.1 s: 50 of 51 samples, at 1 °/h.
    assert_eq!((rows[0].t_s, rows[0].lost_frames, rows[1].lost_frames), (5.1, 50, 0));
    for row in &rows {
        assert!((row.fog_arcsec / row.interval_s - 1.0).abs() < 1e-9, "{row:?}");
    }
}

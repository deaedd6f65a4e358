//! The binary itself: exit codes, what goes to stdout and what to stderr, for every verb.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// What a call of the binary gave.
struct Called {
    code: i32,
    stdout: String,
    stderr: String,
}

fn north_in(folder: &Path, arguments: &[&str]) -> Called {
    let output = Command::new(env!("CARGO_BIN_EXE_north"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Called {
        code: output.status.code().expect("ended by itself"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn north(arguments: &[&str]) -> Called {
    north_in(Path::new("."), arguments)
}

impl Called {
    /// Success, with nothing on stderr.
    fn good(self) -> String {
        assert_eq!((self.code, self.stderr.as_str()), (0, ""), "{}", self.stdout);
        self.stdout
    }

    fn json(self) -> Value {
        serde_json::from_str(&self.good()).unwrap()
    }

    /// Refused with exactly this on stderr.
    fn refused(self, code: i32, stderr: &str) -> String {
        assert_eq!((self.code, self.stderr.as_str()), (code, stderr));
        self.stdout
    }
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn every_verb_has_help_with_an_example() {
    for verb in [&["find"][..], &["solve"], &["simulate"], &["scenarios"], &["completions"], &["man"], &[]] {
        let help = north(&[verb, &["--help"]].concat()).good();
        assert!(help.contains("Example"), "{verb:?}: {help}");
        assert!(help.contains("  north "), "{verb:?}: {help}");
    }
}

#[test]
fn usage_errors_give_2_and_say_what_is_allowed() {
    for (arguments, expected) in [
        (
            &["find", "--latitude", "91"][..],
            "invalid value '91' for '--latitude <DEG>': allowed is a number from -90 to 90",
        ),
        (
            &["find", "--latitude", "nan"],
            "invalid value 'nan' for '--latitude <DEG>': allowed is a number from -90 to 90",
        ),
        (
            &["find", "--azimuth=-361"],
            "invalid value '-361' for '--azimuth <DEG>': allowed is a number from -360 to 360",
        ),
        (&["find", "--dwell", "1"], "invalid value '1' for '--dwell <S>': 1 is not in 2..=3600"),
        (&["find", "--order", "random"], "[possible values: plain, source, mirrored, east-west, adaptive, rotation]"),
        (
            &["find", "--seed", "x"],
            "invalid value 'x' for '--seed <N>': allowed is a whole number from 0 to 18446744073709551615",
        ),
        (&["find", "--seed", "-1"], "invalid value '-1' for '--seed <N>': allowed is a whole number from 0 to "),
        (&["calibrate", "field", "--seed", "-1"], "invalid value '-1' for '--seed <N>': allowed is a whole number"),
        (&["find", "--scenario", "nowhere"], "there is no scenario \"nowhere\"; the built-in ones are: calm-bench, "),
        (&["find", "--no-such-option"], "unexpected argument '--no-such-option' found"),
        (&["simulate"], "--out <DIR>"),
        (&["simulate", "--out", "x", "--runs", "0"], "0 is not in 1..=100000"),
        (&["solve"], "<CAMPAIGN-OR-CSV>"),
        (&["completions", "tcl"], "[possible values: bash, elvish, fish, powershell, zsh]"),
        (&["seek"], "unrecognized subcommand 'seek'"),
        (&[], "Usage: north [OPTIONS] <COMMAND>"),
    ] {
        let called = north(arguments);
        assert_eq!((called.code, called.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(called.stderr.contains(expected), "{arguments:?}: {}", called.stderr);
    }
}

#[test]
fn find_shows_the_fix_in_plain_lines() {
    let shown = north(&["find", "--host", "--seed", "3", "--azimuth", "123.4", "--order", "mirrored"]).good();
    for expected in [
        "calm-bench, seed 3, latitude 34.75°, in this process\n",
        " s  levelling\n",
        " s  level: pitch +0.0",
        " s  base still: rate ",
        " s  position 8 of 8: collecting\n",
        " s  position 8 of 8: 30 s at 0.0",
        "azimuth    123.",
        "true       123.4000°\n",
        " sigma)\n",
        "closure    ",
        "flags      none\n",
    ] {
        assert!(shown.contains(expected), "{expected:?} is not in:\n{shown}");
    }
    assert!(!shown.contains('\u{1b}'), "no escape sequences where there is no terminal");
}

#[test]
fn results_are_tried_before_the_fix_and_the_azimuth_is_said_whatever_becomes_of_them() {
    let folder = folder();
    let find = |results: &[&str]| north_in(folder.path(), &[&["find", "--host", "--azimuth", "5"], results].concat());
    let same = "two results are to be written to this file: give each a file of its own\n";
    assert_eq!(find(&["--json", "a", "--report", "./a"]).refused(1, &format!("north: a: {same}")), "");
    assert_eq!(find(&["--certificate", "b", "--report", "b"]).refused(1, &format!("north: b: {same}")), "");
    fs::write(folder.path().join("file"), "").unwrap();
    assert_eq!(find(&["--record", "file/run"]).stdout, "");
    // A device that is full shows it only when it is written to.
    if cfg!(target_os = "linux") {
        let full = find(&["--json", "/dev/full"]);
        assert!(full.code == 1 && full.stderr.starts_with("north: /dev/full: "), "{}", full.stderr);
        assert!(full.stdout.contains("azimuth    ") && full.stdout.contains("true       5.0000"), "{}", full.stdout);
    }
}

#[test]
fn find_as_json_is_the_documented_object_and_repeats_bit_for_bit() {
    let arguments = ["find", "--host", "--scenario", "disturbed-start", "--order", "plain", "--json", "-"];
    let first = north(&arguments).good();
    assert_eq!(first, north(&arguments).good());
    let found: Value = serde_json::from_str(&first).unwrap();
    assert_eq!(found["engine"], "host");
    assert!((found["true_azimuth_deg"].as_f64().unwrap() - 40.0).abs() < 0.01);
    let run = &found["runs"][0];
    assert!((run["azimuth_deg"].as_f64().unwrap() - 40.0).abs() < 5.0 * run["sigma_deg"].as_f64().unwrap());
    assert!(run["closure_deg_h"].is_f64() && run["file"].is_string());
    assert_eq!(run["dwells"].as_array().unwrap().len(), 4);
    for field in ["index_deg", "seconds", "rate_deg_h", "sigma_deg_h"] {
        assert!(run["dwells"][3][field].is_f64(), "{field}");
    }
    assert!(run["flags"].as_array().unwrap().contains(&"disturbed".into()));
    let events: Vec<_> =
        found["events"].as_array().unwrap().iter().map(|event| event["event"].as_str().unwrap()).collect();
    let mut rest = events.iter();
    for expected in [
        "levelling",
        "level",
        "watching",
        "disturbed",
        "undisturbed",
        "moving",
        "arrived",
        "settled",
        "dwell",
        "fix",
        "finished",
    ] {
        assert!(rest.any(|event| *event == expected), "{expected} is not in its place in {events:?}");
    }
    assert!(found["events"][0]["t_s"].is_f64());
}

#[test]
fn json_goes_to_a_file_beside_the_text() {
    let folder = folder();
    let shown = north_in(folder.path(), &["find", "--host", "--json", "fix.json"]).good();
    assert!(shown.contains("azimuth "));
    let found: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("fix.json")).unwrap()).unwrap();
    let azimuth_deg = found["runs"][0]["azimuth_deg"].as_f64().unwrap();
    assert!(shown.contains(&format!("azimuth    {azimuth_deg:.4}°")));
}

#[test]
fn a_fault_is_exit_code_1_and_still_a_json_object() {
    let folder = folder();
    let called =
        north_in(folder.path(), &["find", "--host", "--scenario", "stalled-motor", "--json", "fix.json", "--force"]);
    let shown = called.refused(1, "north: motor-stall: the encoder does not follow the motor\n");
    assert!(shown.contains("no azimuth: motor-stall while indexing"), "{shown}");
    let found: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("fix.json")).unwrap()).unwrap();
    let run = &found["runs"][0];
    assert!(run["azimuth_deg"].is_null() && run["sigma_deg"].is_null() && run["closure_deg_h"].is_null());
    assert_eq!(run["fault"], "motor-stall");
    let events = found["events"].as_array().unwrap();
    assert!(events.iter().any(|event| event["event"] == "motor-stall" && event["state"] == "indexing"));
}

#[test]
fn near_a_pole_there_is_no_azimuth() {
    let called = north(&["find", "--host", "--latitude", "89.5"]);
    let reason = "north: near-pole: within 1 degree of a pole there is no horizontal Earth rate to find north by\n";
    called.refused(1, reason);
}

#[test]
fn a_recorded_fix_is_solved_to_the_same_azimuth() {
    let folder = folder();
    let record = ["find", "--host", "--latitude=-34", "--record", "fix", "--json", "fix.json"];
    north_in(folder.path(), &record).good();
    let live: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("fix.json")).unwrap()).unwrap();
    assert_eq!(live["runs"][0]["file"], "runs/001.csv");
    let run = fs::read_to_string(folder.path().join("fix/runs/001.csv")).unwrap();
    assert!(run.starts_with("t_s,index_deg,fog_arcsec,temp_c,ax_g,ay_g,lost_frames,"));

    let solved = north_in(folder.path(), &["solve", "fix", "--json", "-"]).json();
    let (live, solved) = (&live["runs"][0], &solved["runs"][0]);
    for field in ["azimuth_deg", "sigma_deg", "closure_deg_h", "flags", "dwells"] {
        assert_eq!(live[field], solved[field], "{field}, with all digits");
    }
    assert!((solved["reference_azimuth_deg"].as_f64().unwrap() - 40.0).abs() < 0.01);
    let bare = ["solve", "fix/runs/001.csv", "--latitude=-34", "--json", "-"];
    let bare = north_in(folder.path(), &bare).json();
    // A bare run is solved by the default settings, not by those that lie beside the campaign's runs.
    let azimuth_deg = |run: &Value| run["azimuth_deg"].as_f64().unwrap();
    assert!((azimuth_deg(&bare["runs"][0]) - azimuth_deg(solved)).abs() < 1e-3);

    let refused =
        "north: fix: the folder is not empty; recordings are never overwritten: name a new folder or empty this one\n";
    north_in(folder.path(), &record).refused(1, refused);
}

#[test]
fn a_simulated_campaign_has_its_headings_around_the_circle() {
    let folder = folder();
    let arguments = ["simulate", "--scenario", "southern-site", "--runs", "4", "--seed", "7", "--out", "campaign"];
    assert_eq!(north_in(folder.path(), &arguments).good(), "campaign: 4 runs\n");
    let table = north_in(folder.path(), &["solve", "campaign"]).good();
    assert_eq!(table.matches("runs/00").count(), 4, "{table}");
    assert!(table.contains("4 runs with a reference: error 0.0"), "{table}");
    let solved = north_in(folder.path(), &["solve", "campaign", "--json", "-"]).json();
    let runs = solved["runs"].as_array().unwrap();
    for (number, run) in runs.iter().enumerate() {
        let reference = run["reference_azimuth_deg"].as_f64().unwrap();
        let first = runs[0]["reference_azimuth_deg"].as_f64().unwrap();
        assert!(((reference - first - 90.0 * number as f64 + 540.0).rem_euclid(360.0) - 180.0).abs() < 1e-6);
        assert!(run["error_deg"].as_f64().unwrap().abs() < 5.0 * run["sigma_deg"].as_f64().unwrap());
    }
    let manifest = fs::read_to_string(folder.path().join("campaign/campaign.toml")).unwrap();
    assert_eq!(manifest.matches("role = \"fit\"").count(), 2);

    let again = ["simulate", "--scenario", "southern-site", "--runs", "4", "--seed", "7", "--out", "again"];
    north_in(folder.path(), &again).good();
    for file in ["campaign.toml", "runs/001.csv", "runs/004.csv"] {
        let read = |campaign: &str| fs::read(folder.path().join(campaign).join(file)).unwrap();
        assert!(read("campaign") == read("again"), "{file} differs");
    }
}

#[test]
fn a_simulated_run_is_the_fix_of_its_seed_and_heading() {
    let folder = folder();
    let simulate = ["simulate", "--runs", "2", "--seed", "5", "--azimuth", "77", "--out", "campaign"];
    north_in(folder.path(), &simulate).good();
    let find = ["find", "--host", "--seed", "6", "--azimuth", "77", "--record", "fix"];
    north_in(folder.path(), &find).good();
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).unwrap();
    assert_eq!(read("campaign/runs/002.csv"), read("fix/runs/001.csv"));
}

#[test]
fn raw_rows_are_solved_like_seconds() {
    let folder = folder();
    for (campaign, raw) in [("raw", &["--raw"][..]), ("seconds", &[])] {
        let simulate = ["simulate", "--scenario", "lossy-link", "--runs", "1", "--order", "plain", "--out", campaign];
        north_in(folder.path(), &[&simulate[..], raw].concat()).good();
    }
    let solve = |campaign: &str| north_in(folder.path(), &["solve", campaign, "--json", "-"]).json();
    let (raw, seconds) = (solve("raw"), solve("seconds"));
    let value = |solved: &Value, field: &str| solved["runs"][0][field].as_f64().unwrap();
    let apart = value(&raw, "azimuth_deg") - value(&seconds, "azimuth_deg");
    assert!(apart.abs() < 0.5 * value(&seconds, "sigma_deg"), "{apart}");
    let lines = fs::read_to_string(folder.path().join("raw/runs/001.csv")).unwrap().lines().count();
    assert!(lines > 50_000, "{lines}");
}

#[test]
fn faults_in_a_simulated_campaign_are_told() {
    let folder = folder();
    let called =
        north_in(folder.path(), &["simulate", "--scenario", "stalled-motor", "--runs", "1", "--out", "campaign"]);
    let shown = called.refused(1, "north: 1 of 1 fix ended without an azimuth\n");
    assert_eq!(shown, "runs/001.csv: the fix ended without an azimuth: motor-stall\ncampaign: 1 run\n");
    let called = north_in(folder.path(), &["solve", "campaign"]);
    assert_eq!(called.code, 1);
    assert!(called.stderr.ends_with("in fewer than three different directions\n"), "{}", called.stderr);
}

#[test]
fn a_bare_run_needs_its_latitude() {
    let folder = folder();
    std::fs::write(folder.path().join("run.csv"), "t_s,index_deg,fog_arcsec\n1,0,10\n").unwrap();
    let reason = "north: run.csv is not a campaign: the latitude of a bare run must be given with --latitude\n";
    north_in(folder.path(), &["solve", "run.csv"]).refused(2, reason);
    let missing = "north: run.csv: No such file or directory (os error 2)\n";
    north(&["solve", "run.csv"]).refused(1, missing);
    north(&["solve", "run.csv", "--latitude", "10"]).refused(1, missing);
    north(&["solve", "nothing.toml"]).refused(1, "north: nothing.toml: No such file or directory (os error 2)\n");
}

#[test]
fn a_wrong_run_is_named_and_the_others_are_solved() {
    let folder = folder();
    north_in(folder.path(), &["simulate", "--runs", "2", "--out", "campaign", "--order", "plain"]).good();
    let run = folder.path().join("campaign/runs/002.csv");
    let text = fs::read_to_string(&run).unwrap().replacen("\n3,", "\n3,x", 1);
    fs::write(&run, text).unwrap();
    let called = north_in(folder.path(), &["solve", "campaign", "--json", "solved.json"]);
    assert_eq!(called.code, 1);
    assert!(called.stderr.starts_with("north: campaign/runs/002.csv, line 4, column 2 (index_deg): \"x"));
    assert!(called.stderr.ends_with("allowed is a finite decimal number\nnorth: 1 of 2 runs refused\n"));
    assert!(called.stdout.contains("runs/002.csv  refused"));
    let solved: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("solved.json")).unwrap()).unwrap();
    assert!(solved["runs"][0]["azimuth_deg"].is_f64());
    assert!(solved["runs"][1]["azimuth_deg"].is_null());
    assert!(solved["runs"][1]["reason"].as_str().unwrap().contains("line 4, column 2 (index_deg)"));
}

#[test]
fn a_calibration_takes_the_flag_away_and_a_wrong_one_is_refused() {
    let folder = folder();
    let write = |text: &str| fs::write(folder.path().join("M.toml"), text).unwrap();
    let find = |more: &[&str]| north_in(folder.path(), &[&["find", "--host", "--model", "M.toml"], more].concat());
    write("format = 1\nbias_deg_h = 0.3\nscale_error = 0.0002\n");
    assert!(find(&[]).good().contains("flags      none\n"));

    write("format = 1\nbias = 0.3\n");
    let unknown = "north: M.toml, line 2, column 1: unknown field `bias`, expected one of `scale_error`, `bias_deg_h`, `level_drift_arcsec`, `plausible`, `terms`, \
         `rate_terms`, `index_error`, `earth_field`, `base_motion`, `sinusoid`, `effects`, `doubt`\n";
    find(&[]).refused(1, unknown);
    write("format = 3\n");
    find(&[]).refused(
        1,
        "north: M.toml, line 1, column 10: \"format = 3\" is not allowed; allowed is format = 1 or format = 2\n",
    );
    write("format = 1\nscale_error = nan\n");
    let called = find(&[]);
    assert_eq!(called.code, 1);
    assert!(called.stderr.starts_with("north: M.toml, line 2, column 15: \"scale_error = NaN\""), "{}", called.stderr);

    write(
        "format = 1\nterms = [{ coefficients = [0.1], scales = true, basis = { curve = { channel = \"field_nt\", \
         signal = \"value\", function = { powers = { reference = 24.0, degree = 1 } } } } }]\n",
    );
    let refusal = "north: M.toml: \"a term that follows channel `field_nt`\" is not allowed; \
        allowed is what the board measures: temp_c, ax_g, ay_g, supply_v, chip_temp_c, block_temp_c with a block, its named analogue inputs, its time and its index angle\n";
    find(&[]).refused(1, refusal);
    write(&format!(
        "format = 1\nterms = [{}]\n",
        "{ coefficients = [0.0], basis = { step = { t_s = 1.0 } } },".repeat(13)
    ));
    let called = find(&[]);
    assert_eq!(called.code, 1);
    let refusal = "north: M.toml, line 2, column 9: `terms`: more than 12 entries; allowed are 12 at most\n";
    assert_eq!(called.stderr, refusal);
}

#[test]
fn scenario_files_and_settings_are_refused_with_field_and_line() {
    let folder = folder();
    let find = |scenario: &str, settings: &str| {
        fs::write(folder.path().join("s.toml"), scenario).unwrap();
        fs::write(folder.path().join("settings.toml"), settings).unwrap();
        north_in(folder.path(), &["find", "--host", "--scenario", "s.toml", "--settings", "settings.toml"])
    };
    let head = "name = \"s\"\n";
    find(head, "").good();
    find(&format!("{head}[instrument.sequence]\norder = {{ custom = [0, 120, 240] }}\n"), "[jitter]\nseconds = 4\n")
        .good();
    find(&format!("{head}[instrument.sequence]\norder = \"mirrored\"\n"), "[sequence]\norder = \"adaptive\"\n").good();
    for (scenario, settings, expected) in [
        (
            "",
            "[sequence]\norder = \"custom\"\n",
            "settings.toml, line 2, column 9: `sequence.order`: the order custom needs its angles",
        ),
        ("", "[sequence]\norder = \"random\"\n", "unknown variant `random`, expected one of `plain`, `source`"),
        (
            "[site]\nlatitude_deg = 91\n",
            "",
            "s.toml:3: site.latitude_deg = 91.0 is out of range; allowed: -90.0 to 90.0",
        ),
        ("[sight]\n", "", "s.toml:2:2: `[sight]`: unknown field `sight`, expected one of "),
        ("[instrument]\ndwell = 3\n", "", "s.toml, line 3, column 1: unknown field `dwell`, expected one of "),
        (
            "[instrument.index]\nretries = 21\n",
            "",
            "s.toml, line 3, column 11: \"index.retries = 21\" is not allowed; allowed is 0 to 20",
        ),
        (
            "",
            "latitude_deg = 95\n",
            "settings.toml, line 1, column 16: \"latitude_deg = 95\" is not allowed; allowed is -90 to 90",
        ),
        (
            "",
            "[jitter]\nseconds = \"five\"\n",
            "settings.toml, line 2, column 11: `jitter.seconds`: invalid type: string \"five\", expected a whole number, 0 or more",
        ),
        (
            "",
            "[sequence]\norder = { custom = [0, 180, 360] }\n",
            "settings.toml, line 2, column 20: \"sequence.order.custom = 2\" is not allowed; allowed is at least 3 different \
             directions",
        ),
        (
            "",
            "[gyro]\narw_deg_per_sqrt_h = 0.5\n",
            "\"disturbance.threshold_deg_h = 2\" is not allowed; allowed is at least ",
        ),
    ] {
        let called = find(&format!("{head}{scenario}"), settings);
        assert_eq!((called.code, called.stdout.as_str()), (1, ""), "{}", called.stderr);
        assert!(called.stderr.contains(expected), "{} is not {expected}", called.stderr);
    }
    let called = north(&["find", "--host", "--scenario", "no/such.toml"]);
    assert_eq!(called.code, 1);
    assert!(called.stderr.starts_with("north: no/such.toml: cannot be read: "), "{}", called.stderr);
}

#[test]
fn scenarios_are_listed() {
    let listed = north(&["scenarios"]).good();
    assert!(listed.starts_with("calm-bench "), "{listed}");
    assert!(listed.contains("\nwindy-tripod "));
}

#[test]
fn completions_and_manual_page() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        assert!(north(&["completions", shell]).good().contains("simulate"), "{shell}");
    }
    let page = north(&["man"]).good();
    assert!(page.contains(".TH north 1"));
    for verb in ["FIND", "SOLVE", "SIMULATE", "BENCH", "SCENARIOS"] {
        assert!(page.contains(&format!(".SH \"NORTH {verb}\"")), "{verb}");
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_north"))
        .arg("scenarios")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

/// Where results cannot go is said before the work, not after.
#[test]
fn results_that_have_no_place_are_refused_at_once() {
    let folder = folder();
    fs::write(folder.path().join("there.json"), "mine").unwrap();
    let find = |file| north_in(folder.path(), &["find", "--host", "--json", file]);
    let refused = "north: there.json: the file exists, and nothing is overwritten without --force\n";
    assert_eq!(find("there.json").refused(1, refused), "");
    assert_eq!(find("none/fix.json").refused(1, "north: none/fix.json: there is no such folder to put it into\n"), "");
    assert_eq!(fs::read_to_string(folder.path().join("there.json")).unwrap(), "mine");
}

#[test]
fn scenario_files_are_documented_as_they_are() {
    let described = north(&["scenarios", "--describe"]).good();
    assert!(include_str!("../../docs/scenarios.md").trim_end().ends_with(described.trim_end()), "{described}");
}

/// The example of docs/scenarios.md finds north.
#[test]
fn the_documented_scenario_finds_north() {
    let folder = folder();
    let text = include_str!("../../docs/scenarios.md");
    let (_, example) = text.split_once("```toml\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    fs::write(folder.path().join("cold-morning.toml"), example).unwrap();
    let shown = north_in(folder.path(), &["find", "--host", "--scenario", "cold-morning.toml"]).good();
    assert!(shown.starts_with("cold-morning, seed 1, latitude 60.2°") && shown.contains("\nazimuth "), "{shown}");
}

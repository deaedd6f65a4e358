//! The tools that talk to a board, over a pseudo-terminal to an instrument in a process.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::thread;
use std::time::Duration;

use crate::common::{Board, command, north};
use serde_json::Value;

/// A board a hundred times as fast as a real one.
fn board(arguments: &[&str]) -> Board {
    Board::on(&[&["--speed", "100"], arguments].concat())
}

impl Board {
    /// What a command says that talks to it: exit code, stdout, stderr.
    fn run(&self, arguments: &[&str]) -> (i32, String, String) {
        let arguments: Vec<&str> =
            arguments.iter().map(|&argument| if argument == "PORT" { &self.port } else { argument }).collect();
        north(&arguments)
    }

    fn good(&self, arguments: &[&str]) -> String {
        let (code, said, error) = self.run(arguments);
        assert_eq!(code, 0, "{arguments:?}: {said}{error}");
        said
    }
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_str().unwrap().to_owned()
}

#[test]
fn settings_go_down_and_up() {
    let folder = tempfile::tempdir().unwrap();
    let board = board(&[]);
    assert_eq!(board.good(&["settings", "get", "latitude_deg", "--port", "PORT"]), "latitude_deg = 34.75\n");
    let before = path(&folder, "before.toml");
    board.good(&["settings", "dump", "--out", &before, "--port", "PORT"]);

    // All that is wrong, at once, as numbers; nothing is changed.
    let wrong = ["latitude_deg=91", "level.seconds=0", "gyro.arw_deg_per_sqrt_h=0.01"];
    let (code, _, error) = board.run(&[&["settings", "set"], &wrong[..], &["--port", "PORT"]].concat());
    for part in ["latitude_deg = 91", "level.seconds = 0", "disturbance.threshold_deg_h", "at least 4 ", "4.243"] {
        assert!(code == 1 && error.contains(part), "{part}: {error}");
    }
    board.good(&["settings", "set", "latitude_deg=47.37", "sequence.order=plain", "--port", "PORT"]);
    let group = board.good(&["settings", "get", "latitude_deg", "sequence", "--port", "PORT"]);
    assert!(group.starts_with("latitude_deg = 47.37\n[sequence]\n") && group.contains("order = \"plain\""), "{group}");

    let model = path(&folder, "m.toml");
    fs::write(&model, "format = 1\nscale_error = 0.001\nbias_deg_h = 0.25\n").unwrap();
    board.good(&["load", &model, "--port", "PORT"]);
    assert!(board.good(&["settings", "get", "model.bias_deg_h", "--port", "PORT"]).contains("= 0.25"));
    let dwell = path(&folder, "dwell.toml");
    fs::write(&dwell, "[sequence]\ndwell_s = 45\n").unwrap();
    board.good(&["load", &dwell, "--port", "PORT"]);
    assert!(board.good(&["settings", "get", "--port", "PORT"]).contains("dwell_s = 45"));

    board.good(&["settings", "restore", &before, "--port", "PORT"]);
    assert_eq!(board.good(&["settings", "dump", "--port", "PORT"]), fs::read_to_string(&before).unwrap());
    // A file that is there stays as it is.
    let (code, _, error) = board.run(&["settings", "dump", "--out", &before, "--port", "PORT"]);
    assert!(code == 1 && error.contains("nothing is overwritten"), "{error}");
}

/// The recording of a fix, frame by frame over the port, gives the fix that the instrument made, with all digits.
#[test]
fn a_recorded_fix_is_the_fix() {
    let folder = tempfile::tempdir().unwrap();
    let board = board(&["--scenario", "windy-tripod"]);
    for rows in [&[][..], &["--means"]] {
        let out = path(&folder, if rows.is_empty() { "raw" } else { "means" });
        let made = board.good(&[&["record", "PORT", "--fix", "--json", "-", "--out", &out], rows].concat());
        let (_, solved, _) = north(&["solve", &out, "--json", "-"]);
        let [made, solved]: [Value; 2] = [made, solved].map(|text| serde_json::from_str(&text).unwrap());
        // The closure is null in both: at this heading the default order measures three angles only.
        assert_eq!(made["runs"][0]["closure_deg_h"], solved["runs"][0]["closure_deg_h"]);
        for name in ["azimuth_deg", "sigma_deg", "chi_square", "flags"] {
            assert!(
                !made["runs"][0][name].is_null() && made["runs"][0][name] == solved["runs"][0][name],
                "{name}: {made} {solved}"
            );
        }
    }
    let out = path(&folder, "short");
    let said = board.good(&["record", "PORT", "--seconds", "5", "--out", &out]);
    // 400 rows a second, within what the line carries: 115200 baud are 11520 bytes a second.
    let most: u64 = said.split("at most ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
    assert!(said.contains("2000 rows") && (3000..11_520).contains(&most), "{said}");
    assert!(Path::new(&out).join("settings.toml").exists());
}

/// A fix is in the board's log, over a start with other settings too: with the digits that the log holds, at the time of day that a host has told.
#[test]
fn a_fix_is_in_the_log_of_the_board() {
    let folder = tempfile::tempdir().unwrap();
    let board = board(&["--scenario", "windy-tripod"]);
    let log = path(&folder, "log.csv");
    assert!(board.good(&["log", "PORT", "--out", &log]).contains("0 fixes"));
    let (code, _, error) = board.run(&["log", "PORT", "--check", "10"]);
    assert!(code == 1 && error.contains("no-fix-yet"), "{error}");
    board.good(&["settings", "clock", "--port", "PORT"]);
    let made = board.good(&["record", "PORT", "--fix", "--json", "-", "--out", &path(&folder, "fix")]);
    let made: Value = serde_json::from_str(&made).unwrap();
    let azimuth_deg = made["runs"][0]["azimuth_deg"].as_f64().unwrap();
    board.good(&["log", "PORT", "--check", &azimuth_deg.to_string()]);
    board.good(&["settings", "set", "sequence.dwell_s=50", "--port", "PORT"]);
    board.good(&["log", "PORT", "--force", "--out", &log]);
    let text = fs::read_to_string(&log).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let [header, row] = &rows[..] else { panic!("{text}") };
    let column = |name: &str| row[header.iter().position(|column| *column == name).unwrap()];
    let number = |name: &str| column(name).parse::<f64>().unwrap();
    assert!((number("azimuth_deg") - azimuth_deg).abs() < 1.1e-5 && (number("check_deg") - azimuth_deg).abs() < 1e-9);
    assert_eq!((column("fix"), column("boot")), ("1", "1"));
    assert!(column("utc").starts_with("20") && column("utc").ends_with('Z') && number("t_s") > 100.0, "{text}");
    let bias_deg_h = made["runs"][0]["bias_deg_h"].as_f64().unwrap();
    assert!((number("bias_deg_h") - bias_deg_h).abs() <= bias_deg_h.abs() / 65_536.0);
    assert!(number("scatter_deg_h") > 0.0 && number("supply_v") > 5.0 && number("chip_temp_c") > -40.0, "{text}");
}

/// A client that went without stopping the stream costs the next recording nothing.
#[test]
fn a_stream_that_was_left_on_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let board = board(&["--scenario", "windy-tripod"]);
    // It is killed in mid-recording, at whatever place in a second: the stream stays on.
    let out = path(&folder, "killed");
    let mut client = command(&["record", &board.port, "--out", &out]).stdout(Stdio::null()).spawn().unwrap();
    let rows = Path::new(&out).join("runs/001.csv");
    while fs::metadata(&rows).map_or(0, |file| file.len()) < 100_000 {
        assert_eq!(client.try_wait().unwrap(), None);
        thread::sleep(Duration::from_millis(3));
    }
    client.kill().unwrap();
    client.wait().unwrap();
    // What it wrote is there, and whoever asks for it is told.
    assert!(fs::read_to_string(&rows).unwrap().lines().count() > 400);
    let (code, _, error) = north(&["solve", &out]);
    assert!(code == 1 && error.contains("came to no end"), "{error}");

    let out = path(&folder, "next");
    let made = board.good(&["record", "PORT", "--fix", "--json", "-", "--out", &out]);
    let (_, solved, _) = north(&["solve", &out, "--json", "-"]);
    let [made, solved]: [Value; 2] = [made, solved].map(|text| serde_json::from_str(&text).unwrap());
    for name in ["azimuth_deg", "sigma_deg"] {
        assert!(made["runs"][0][name].is_f64() && made["runs"][0][name] == solved["runs"][0][name], "{made} {solved}");
    }
}

/// The cable is pulled: what came until then is a recording.
#[test]
fn a_broken_line_loses_nothing_that_came() {
    let folder = tempfile::tempdir().unwrap();
    let mut board = board(&[]);
    let out = path(&folder, "cut");
    let client = command(&["record", &board.port, "--out", &out]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let rows = Path::new(&out).join("runs/001.csv");
    // More than the minute that an Allan curve needs.
    while fs::metadata(&rows).map_or(0, |file| file.len()) < 3_500_000 {
        thread::sleep(Duration::from_millis(3));
    }
    let before = fs::read_to_string(&rows).unwrap().lines().count();
    board.switch_off();
    let ended = client.unwrap().wait_with_output().unwrap();
    let error = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(1) && error.contains(&board.port), "{error}");
    let after = fs::read_to_string(&rows).unwrap().lines().count();
    assert!(after >= before && (after - 1).is_multiple_of(400), "{before} {after}");
    let (code, said, error) = north(&["characterise", rows.to_str().unwrap()]);
    assert!(code == 0, "{said}{error}");
    assert!(Path::new(&out).join("campaign.toml").exists());
}

#[test]
fn the_accelerometers_are_calibrated_over_the_port() {
    let board = board(&["--scenario", "worn-accelerometers"]);
    let said = board.good(&["calibrate", "field", "--port", &board.port]);
    assert!(said.contains("up\n") && said.contains("attitude 18 accepted") && said.ends_with("stored\n"), "{said}");
    assert!(board.good(&["settings", "get", "accelerometer", "--port", "PORT"]).contains("bias_g"));
}

#[test]
fn the_doctor_finds_what_is_wrong() {
    let said = board(&[]).good(&["doctor", "--port", "PORT"]);
    let parts = [
        "good  gyro frames    All ",
        "good  accelerometers",
        "good  latitude",
        "good  encoder",
        "good  level",
        "good  self-test      Gyro-rate passed: the gyro sends 400 frames a second; 394 to 406 are allowed",
        "good  self-test      Accelerometer-response passed: the accelerometer's own test force moves its reading by 1.5 g; 0.5 to 3 are allowed",
        "good  self-test      Index-drive passed: a move of 5° ended ",
        "n/a   self-test      Memory was not tested: this board has no such test.",
        "n/a   self-test      Block was not tested: this board has no such part",
        "good  fix            Azimuth ",
    ];
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!said.contains("BAD"), "{said}");
    // Of play and the encoder's noise nothing may be left, or some hundredths of a degree.
    assert!((0.0..0.2).contains(&degrees_of_the_drive(&said)), "{said}");
    let (code, said, _) = board(&["--scenario", "stalled-motor"]).run(&["doctor", "--port", "PORT"]);
    let bad: Vec<&str> = said.lines().filter(|line| line.starts_with("BAD")).collect();
    assert!(code == 1 && bad.len() == 1, "{said}");
    // The spindle does not turn, but for play and the encoder's noise: nearly all of the five degrees are missing.
    assert!(bad[0].contains("Index-drive failed: ") && (4.8..5.2).contains(&degrees_of_the_drive(bad[0])), "{said}");
    assert!(bad[0].contains(". To do: free the spindle"), "{said}");
    assert!(said.contains("look  fix            None was tried"), "{said}");
    let said = board(&["--scenario", "stalled-motor"]).good(&["doctor", "--still", "--port", "PORT"]);
    assert!(!said.contains("self-test"), "{said}");
    let (code, said, error) = board(&["--scenario", "lossy-link"]).run(&["doctor", "--port", "PORT", "--json", "-"]);
    let findings: Value = serde_json::from_str(&said).unwrap();
    let frames = findings.as_array().unwrap().iter().find(|finding| finding["what"] == "gyro frames").unwrap();
    assert!(code == 1 && frames["verdict"] == "bad" && error.contains("checks are bad"), "{said}{error}");
}

/// By how much the self-test's move of the index drive missed its end, as the doctor says it.
fn degrees_of_the_drive(said: &str) -> f64 {
    let missed = said.split("a move of 5° ended ").nth(1).and_then(|rest| rest.split('°').next());
    missed.and_then(|degrees| degrees.parse().ok()).unwrap_or_else(|| panic!("no degrees: {said}"))
}

/// Faults that nothing but a fix brings to light, or that the parts show; `find` gives no azimuth with the first five, and a flag with the last.
#[test]
fn the_doctor_is_as_hard_to_please_as_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    let worlds = [
        ("[[gyro.faults]]\nkind = \"stuck\"\nfrom_s = 2.0\n", "gyro noise", "the gyro repeats itself"),
        ("[[gyro.faults]]\nkind = \"stuck\"\nfrom_s = 100.0\n", "fix", "(gyro-stuck, while "),
        ("[gyro]\nbias_deg_h = 50.0\n", "fix", "(gyro-units, while watching)"),
        ("[gyro]\narw_deg_per_sqrt_h = 0.15\n", "fix", "-too-long, while "),
        ("[base]\npitch_deg = 2.0\n", "fix", "(not-level-in-time, while levelling)"),
        ("[encoder]\nslip_deg = 3.0\nslip_at_s = 60.0\n", "flag", "(index-slip). To do: check spindle"),
    ];
    for (number, (world, what, part)) in worlds.into_iter().enumerate() {
        let file = path(&folder, &format!("{number}.toml"));
        fs::write(&file, format!("name = \"w\"\ndescription = \"w\"\n{world}")).unwrap();
        // The second fault is to come after the doctor's look at the rates, and before the fix is over, on a busy machine too.
        let speed = if number == 1 { "50" } else { "1000" };
        let board = Board::on(&["--speed", speed, "--scenario", &file]);
        let (code, said, _) = board.run(&["doctor", "--port", "PORT"]);
        let bad: Vec<&str> = said.lines().filter(|line| line.starts_with("BAD")).collect();
        let named = |line: &&&str| line.contains(&format!("BAD   {what:<14} ")) && line.contains(part);
        assert!(code == 1 && bad.iter().any(|line| named(&line)), "{world}: {said}");
        // Without a fix what the parts show is as bad, as there is nothing else to go by.
        if (2..=4).contains(&number) {
            let (code, said, _) = board.run(&["doctor", "--no-fix", "--port", "PORT"]);
            assert!(code == 1 && !said.contains("  fix "), "{world}: {said}");
        }
    }
}

/// The last attitude of a calibration: the instrument lies on its side, and its accelerometers work.
#[test]
fn the_doctor_knows_that_an_instrument_is_not_upright() {
    let board = board(&["--scenario", "worn-accelerometers"]);
    board.good(&["calibrate", "field", "--port", &board.port]);
    let (code, said, _) = board.run(&["doctor", "--port", "PORT"]);
    assert!(code == 1 && said.contains("BAD   level          It is not upright: up is ("), "{said}");
}

#[test]
fn a_frame_that_cannot_be_read_is_answered_with_number_0() {
    use north_finder::event::Event;
    use north_finder::health::Refusal;
    use std::io::{Read, Write};
    let board = board(&[]);
    let patience = std::time::Duration::from_secs(10);
    let mut line = serialport::new(&board.port, 115_200).timeout(patience).open().unwrap();
    // A frame of three bytes of content, whose check sum is none.
    line.write_all(&[0, 8, 1, 2, 3, 4, 5, 6, 7, 0]).unwrap();
    let mut decoder = north_finder::link::ReportDecoder::new();
    let mut byte = [0];
    let answer = loop {
        line.read_exact(&mut byte).unwrap();
        if let Some(Ok(report)) = decoder.feed(byte[0])
            && let Event::Answer { .. } = report.event
        {
            break report.event;
        }
    };
    assert_eq!(answer, Event::Answer { number: 0, refusal: Some(Refusal::Damaged) });
}

#[test]
fn a_port_on_which_nobody_answers_is_said_to_be_one() {
    let (_line, other_end) = serialport::TTYPort::pair().unwrap();
    let name = serialport::SerialPort::name(&other_end).unwrap();
    drop(other_end);
    let (code, _, error) = north(&["settings", "get", "--port", &name]);
    assert!(code == 1 && error.contains(&name) && error.contains("no answer"), "{error}");
}

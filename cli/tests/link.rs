//! The link as another language reads it: docs/link.py, which shares nothing with the firmware, talks to an instrument.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::Board;
use north_finder::health::Item;
use serde_json::Value;

/// The reports that Python reads of an instrument.
fn reports(board: &[&str], python: &[&str]) -> Option<Vec<Value>> {
    if Command::new("python3").arg("--version").stdout(Stdio::null()).status().is_err() {
        println!("skipped: no python3");
        return None;
    }
    let board = Board::on(board);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/link.py");
    let output = Command::new("python3").arg(script).arg(&board.port).args(python).output().unwrap();
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success() && error.is_empty(), "{said}\n{error}");
    Some(said.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

fn named<'a>(reports: &'a [Value], name: &str) -> Vec<&'a Value> {
    reports.iter().filter(|report| report["event"] == name).collect()
}

/// Identity, answers, a whole fix, and a raw stream whose increments sum up to the seconds that the instrument reports: nothing
/// was lost. At 30 times real time the stream has 30 times the bytes of a board.
#[test]
fn python_reads_a_fix_and_its_raw_stream() {
    let Some(reports) = reports(&["--speed", "30", "--seed", "1", "--order", "mirrored"], &["--start", "--raw"]) else {
        return;
    };
    let identity = named(&reports, "identity");
    assert_eq!(
        (identity.len(), &identity[0]["board"], &identity[0]["version"]),
        (1, &"host".into(), &env!("CARGO_PKG_VERSION").into())
    );
    let answers: Vec<(u64, bool)> = named(&reports, "answer")
        .iter()
        .map(|answer| (answer["number"].as_u64().unwrap(), answer["refusal"].is_null()))
        .collect();
    assert_eq!(answers, [(1, true), (2, true), (3, true), (4, true), (5, true)]);
    let azimuth_deg = named(&reports, "fix")[0]["azimuth_deg"].as_f64().unwrap();
    // The scenario's mark stands at 40°; the mirrored order has a sigma of 0.04°, and five of them are a fault.
    assert!((azimuth_deg - 40.0).abs() < 0.2, "{azimuth_deg}");

    let seconds: Vec<_> =
        named(&reports, "second").into_iter().filter(|second| second["raw_frames"].is_number()).collect();
    assert!(seconds.len() > 200, "{}", seconds.len());
    for second in seconds {
        assert_eq!(second["raw_frames"], 400, "{second}");
        let raw_arcsec = second["raw_counts"].as_f64().unwrap() * 1e-6;
        assert!((raw_arcsec - second["fog_arcsec"].as_f64().unwrap()).abs() < 1e-9, "{second}");
    }
}

/// Every item, in its order: all pass but for those of a board, of a block and of a limit switch, which are not there.
#[test]
fn python_asks_for_the_self_test() {
    let Some(reports) = reports(&["--speed", "100"], &["--self-test"]) else { return };
    let asked = reports.iter().rposition(|report| report["event"] == "answer").unwrap();
    let told: Vec<(&str, &str)> = named(&reports[asked..], "self-test")
        .iter()
        .map(|item| (item["item"].as_str().unwrap(), item["verdict"].as_str().unwrap()))
        .collect();
    let expected = Item::ALL.iter().map(|item| {
        let absent = item.is_of_board() || matches!(item, Item::Block | Item::Limit);
        (item.name(), if absent { "absent" } else { "passed" })
    });
    assert_eq!(told, expected.collect::<Vec<_>>());
    let rate = named(&reports[asked..], "self-test")[5];
    assert_eq!((&rate["measured"], &rate["allowed"]), (&400.0.into(), &serde_json::json!([394.0, 406.0])));
}

#[test]
fn python_is_told_why_no_fix_can_be_started() {
    let Some(reports) = reports(&["--speed", "100", "--latitude", "89.5"], &["--start"]) else { return };
    assert_eq!(named(&reports, "fault")[0]["fault"], "near-pole");
    assert_eq!(named(&reports, "answer").last().unwrap()["refusal"], "no-fix");
}

//! The instrument behind a pseudo-terminal, as its users meet it.

use std::fs::File;
use std::io::Read;
use std::time::{Duration, Instant};

use crate::common::{Board, command};

/// A board a thousand times as fast as a real one.
fn board(arguments: &[&str]) -> Board {
    Board::on(&[&["--speed", "1000"], arguments].concat())
}

impl Board {
    /// What comes out of the port until `enough`.
    fn bytes(&self, enough: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        let mut line = File::open(&self.port).unwrap();
        let (mut bytes, start) = (Vec::new(), Instant::now());
        while !enough(&bytes) {
            assert!(start.elapsed() < Duration::from_secs(60), "{} bytes", bytes.len());
            let mut some = [0; 256];
            let count = line.read(&mut some).unwrap();
            bytes.extend(&some[..count]);
        }
        bytes
    }
}

#[test]
fn a_fix_over_the_port() {
    let board = board(&["--seed", "1"]);
    let monitor = command(&["monitor", &board.port, "--start", "--once"]).output().unwrap();
    let shown = String::from_utf8_lossy(&monitor.stdout);
    assert!(monitor.status.success(), "{shown}\n{}", String::from_utf8_lossy(&monitor.stderr));
    // The scenario's mark stands at 40°; the default order has a sigma of 0.04°, and five of them are a fault.
    let azimuth = shown.lines().find_map(|line| line.strip_prefix("azimuth    ")).unwrap();
    let azimuth_deg: f64 = azimuth.split('°').next().unwrap().parse().unwrap();
    assert!((azimuth_deg - 40.0).abs() < 0.2, "{shown}");
}

#[test]
fn headings_as_any_plotter_reads_them() {
    let board = board(&["--nmea"]);
    let text = board.bytes(|bytes| bytes.windows(7).any(|window| window == b"$HEHDT,") && bytes.ends_with(b"\n"));
    let text = String::from_utf8(text).unwrap();
    // The line is joined in the middle of a sentence.
    let heading = text.lines().filter(|line| line.starts_with("$HEHDT")).find_map(|line| nmea::parse_str(line).ok());
    let Some(nmea::ParseResult::HDT(heading)) = heading else { panic!("{text}") };
    assert!((heading.heading.unwrap() - 40.0).abs() < 0.2, "{text}");
    assert!(text.lines().any(|line| line.starts_with("$HETHS,39.") || line.starts_with("$HETHS,40.")), "{text}");
}

#[test]
fn a_port_that_is_none_is_refused_by_name() {
    let monitor = command(&["monitor", "/dev/null/none"]).output().unwrap();
    let said = String::from_utf8_lossy(&monitor.stderr);
    assert_eq!((monitor.status.code(), said.starts_with("north: /dev/null/none: ")), (Some(1), true), "{said}");
}

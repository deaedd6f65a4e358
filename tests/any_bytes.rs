//! A short run of every fuzz target: no decoder and no reader of files panics or hangs, whatever the bytes are.

use std::time::{Duration, Instant};

use proofs::any_bytes::{READERS, exercise};

/// Cases of each. They take a tenth of a second.
const CASES: u32 = 300;

#[test]
fn whatever_the_bytes_are_every_reader_gives_a_value_or_an_error() {
    for (reader, seed) in READERS.iter().zip(1..) {
        let start = Instant::now();
        exercise(reader, CASES, seed);
        // A hundred times what it takes: something hangs.
        assert!(start.elapsed() < Duration::from_secs(60), "{}", reader.name);
    }
}

#[test]
fn every_reader_has_its_fuzz_target() {
    let manifest = include_str!("../fuzz/Cargo.toml");
    for reader in READERS {
        assert!(manifest.contains(&format!("name = \"{}\"", reader.name)), "fuzz/Cargo.toml lacks {}", reader.name);
    }
}

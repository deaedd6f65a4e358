//! cargo +nightly fuzz run attitudes
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| proofs::any_bytes::feed("attitudes", bytes));

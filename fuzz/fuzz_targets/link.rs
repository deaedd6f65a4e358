//! Any bytes on the link: the decoder never panics, and the frame after the next 00 is taken.
//!
//! cargo +nightly fuzz run link
#![no_main]

use libfuzzer_sys::fuzz_target;
use north_finder::link::{Ask, Decoder, MAX_REQUEST, Request, encode_request};
use north_finder::sequence::Command;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder: Decoder<Request, MAX_REQUEST> = Decoder::default();
    for &byte in bytes {
        let _ = decoder.feed(byte);
    }
    let _ = decoder.feed(0);
    let request = Request::from(Ask::Command(Command::Start));
    let frame = encode_request(&request).unwrap();
    let found: Vec<_> = frame.iter().filter_map(|&byte| decoder.feed(byte)).collect();
    assert_eq!(found, [Ok(request)]);
});

//! Requests on their way to the instrument.

use std::collections::VecDeque;

use north_finder::link::{BAUD, Request, TooLong, encode_request};

/// What the host's line carries in a tick of 2.5 ms, ten bits a byte.
const BYTES_A_TICK: usize = (BAUD / 10 / 400) as usize;

/// The host's line, as quick as the real one.
#[derive(Debug, Default)]
pub struct RequestLine(VecDeque<u8>);

impl RequestLine {
    /// Puts a request behind those that wait.
    pub fn send(&mut self, request: &Request) -> Result<(), TooLong> {
        self.0.extend(encode_request(request)?);
        Ok(())
    }

    /// What arrives in the next tick.
    pub fn tick(&mut self) -> Vec<u8> {
        self.0.drain(..self.0.len().min(BYTES_A_TICK)).collect()
    }
}

//! The serial line from the gyro: bytes take time, and some of them suffer.

use crate::noise::{Source, Stream};
use crate::scenario::{Link, LinkFault, LinkFaultKind};
use crate::window;
use std::collections::VecDeque;

/// Bits on the line for a byte: start, eight, stop.
const BITS_PER_BYTE: f64 = 10.0;

/// A line with bytes under way.
#[derive(Debug, Clone)]
pub struct Line {
    byte_s: f64,
    faults: Vec<LinkFault>,
    /// Bytes of a run that are still to be hit, for each fault.
    left: Vec<u32>,
    free_s: f64,
    under_way: VecDeque<(f64, u8)>,
    stream: Stream,
}

impl Line {
    /// An idle line.
    pub fn new(link: &Link, seed: u64) -> Self {
        Self {
            byte_s: BITS_PER_BYTE / f64::from(link.baud),
            faults: link.faults.clone(),
            left: vec![0; link.faults.len()],
            free_s: 0.0,
            under_way: VecDeque::new(),
            stream: Stream::new(seed, Source::Line),
        }
    }

    /// Puts bytes on the line at `t_s`, behind those that are still going out.
    pub fn send(&mut self, bytes: &[u8], t_s: f64) {
        self.free_s = self.free_s.max(t_s);
        for &byte in bytes {
            self.send_byte(byte, t_s);
        }
    }

    /// The next byte that has arrived by `t_s`.
    pub fn receive(&mut self, t_s: f64) -> Option<u8> {
        if self.is_ready(t_s) { self.under_way.pop_front().map(|(_, byte)| byte) } else { None }
    }

    /// Whether a byte has arrived by `t_s`.
    pub fn is_ready(&self, t_s: f64) -> bool {
        self.under_way.front().is_some_and(|(arrives_s, _)| *arrives_s <= t_s)
    }

    fn send_byte(&mut self, byte: u8, t_s: f64) {
        let mut byte = byte;
        let mut copies = 1;
        for (fault, left) in self.faults.iter().zip(&mut self.left) {
            if *left == 0 {
                let in_force = window::contains(fault.from_s, fault.to_s, t_s);
                if !in_force || self.stream.uniform() >= fault.probability {
                    continue;
                }
                *left = match fault.kind {
                    LinkFaultKind::Drop | LinkFaultKind::Burst => fault.bytes,
                    LinkFaultKind::Flip | LinkFaultKind::Duplicate | LinkFaultKind::Delay => 1,
                };
            }
            *left -= 1;
            match fault.kind {
                LinkFaultKind::Drop => copies = 0,
                LinkFaultKind::Flip => byte ^= 1 << (self.stream.bits() % 8),
                LinkFaultKind::Duplicate => copies *= 2,
                LinkFaultKind::Delay => self.free_s += fault.delay_s,
                LinkFaultKind::Burst => byte = self.stream.bits() as u8,
            }
        }
        // A lost byte still takes its time.
        self.free_s += self.byte_s * f64::from(copies.max(1));
        for _ in 0..copies {
            self.under_way.push_back((self.free_s, byte));
        }
    }
}

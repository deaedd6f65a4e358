//! What a board leaves for the instrument: bytes of both lines, and counts of all that was lost.

use core::sync::atomic::{AtomicU32, Ordering};

use super::ring::Ring;
use crate::health::Counters;

/// Bytes of 70 ms from the gyro, in its longer format, and of 40 ms from the host: readings wait for 40 ms at most.
pub const GYRO_BYTES: usize = 1024;
pub const HOST_BYTES: usize = 512;

/// What a receiver found wrong with a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// It came before the one before was read, which is lost.
    Overrun,
    /// Its stop bit is wrong. It is among the bytes nevertheless, as with noise: the frame's check sum tells.
    Framing,
    /// Its samples do not agree.
    Noise,
}

/// A line's bytes, and what was lost of them.
#[derive(Debug)]
pub struct Line<const N: usize> {
    ring: Ring<N>,
    overruns: AtomicU32,
    framing_errors: AtomicU32,
    noise_errors: AtomicU32,
    refused: AtomicU32,
}

/// All of it.
#[derive(Debug)]
pub struct Intake {
    pub gyro: Line<GYRO_BYTES>,
    pub host: Line<HOST_BYTES>,
    /// Readings that the solve task had no room for, and reports that the link had no room for.
    pub readings_refused: AtomicU32,
    pub reports_refused: AtomicU32,
    /// Ticks whose work was not done when the next one began.
    pub ticks_late: AtomicU32,
}

/// How many bytes of each line had come at a tick, modulo 2³²: a tick's work takes these and no more, however late it is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    pub gyro: u32,
    pub host: u32,
}

/// Counts one more.
pub fn one_more(count: &AtomicU32) {
    count.fetch_add(1, Ordering::Relaxed);
}

impl<const N: usize> Line<N> {
    const fn new() -> Self {
        Self {
            ring: Ring::new(),
            overruns: AtomicU32::new(0),
            framing_errors: AtomicU32::new(0),
            noise_errors: AtomicU32::new(0),
            refused: AtomicU32::new(0),
        }
    }

    /// Bytes that came.
    pub fn put(&self, bytes: &[u8]) {
        self.ring.put(bytes);
    }

    /// Where bytes go that come by themselves, and how far: see [`Ring::all_places`].
    pub fn ring(&self) -> &Ring<N> {
        &self.ring
    }

    /// A byte that came damaged, or not at all.
    pub fn lost(&self, error: LineError) {
        one_more(match error {
            LineError::Overrun => &self.overruns,
            LineError::Framing => &self.framing_errors,
            LineError::Noise => &self.noise_errors,
        });
    }

    /// Whether nothing waits of what had come at a mark of [`Received`].
    pub fn is_empty(&self, mark: u32) -> bool {
        self.ring.is_empty(mark)
    }

    /// Takes what had come at a mark of [`Received`], as much as there is room for; gives how much. What was overwritten before is counted.
    pub fn take(&self, mark: u32, place: &mut [u8]) -> usize {
        let (length, overwritten) = self.ring.take(mark, place);
        if overwritten > 0 {
            self.refused.fetch_add(overwritten, Ordering::Relaxed);
        }
        length
    }
}

impl Intake {
    #[allow(clippy::new_without_default)] // for a static
    pub const fn new() -> Self {
        Self {
            gyro: Line::new(),
            host: Line::new(),
            readings_refused: AtomicU32::new(0),
            reports_refused: AtomicU32::new(0),
            ticks_late: AtomicU32::new(0),
        }
    }

    /// What has come by now.
    pub fn heard(&self) -> Received {
        Received { gyro: self.gyro.ring.mark(), host: self.host.ring.mark() }
    }

    /// Brings the counters up to date.
    pub fn tell(&self, counters: &mut Counters) {
        let read = |count: &AtomicU32| count.load(Ordering::Relaxed);
        counters.bytes_refused = read(&self.gyro.refused);
        counters.gyro_overruns = read(&self.gyro.overruns);
        counters.gyro_framing_errors = read(&self.gyro.framing_errors);
        counters.gyro_noise_errors = read(&self.gyro.noise_errors);
        counters.host_bytes_refused = read(&self.host.refused);
        counters.host_overruns = read(&self.host.overruns);
        counters.host_framing_errors = read(&self.host.framing_errors);
        counters.host_noise_errors = read(&self.host.noise_errors);
        counters.readings_refused = read(&self.readings_refused);
        counters.reports_refused = read(&self.reports_refused);
        counters.ticks_late = read(&self.ticks_late);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loss_has_its_counter() {
        let intake = Intake::new();
        intake.gyro.put(&[0; GYRO_BYTES + 3]);
        intake.host.put(&[0; HOST_BYTES + 2]);
        let heard = intake.heard();
        assert_eq!((intake.gyro.take(heard.gyro, &mut [0; 8]), intake.host.take(heard.host, &mut [0; 9])), (8, 9));
        intake.gyro.lost(LineError::Overrun);
        (0..4).for_each(|_| intake.gyro.lost(LineError::Framing));
        (0..5).for_each(|_| intake.gyro.lost(LineError::Noise));
        (0..6).for_each(|_| intake.host.lost(LineError::Overrun));
        (0..7).for_each(|_| intake.host.lost(LineError::Framing));
        (0..8).for_each(|_| intake.host.lost(LineError::Noise));
        (0..9).for_each(|_| one_more(&intake.readings_refused));
        (0..10).for_each(|_| one_more(&intake.reports_refused));
        (0..11).for_each(|_| one_more(&intake.ticks_late));
        let mut counters = Counters::default();
        intake.tell(&mut counters);
        let expected = Counters {
            bytes_refused: 3,
            host_bytes_refused: 2,
            gyro_overruns: 1,
            gyro_framing_errors: 4,
            gyro_noise_errors: 5,
            host_overruns: 6,
            host_framing_errors: 7,
            host_noise_errors: 8,
            readings_refused: 9,
            reports_refused: 10,
            ticks_late: 11,
            ..Counters::default()
        };
        assert_eq!(counters, expected);
    }
}

//! Bytes from an interrupt to a task, without locks: one side puts, the other takes.
//!
//! Not the queue of heapless: this one is a static that both sides share by reference, and is emptied in slices.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Room for N bytes, a power of two. In C's order: a debugger finds how many bytes have come at its beginning.
#[derive(Debug)]
#[repr(C)]
pub struct Ring<const N: usize> {
    /// Bytes ever put, and ever taken, modulo 2³².
    put: AtomicU32,
    taken: AtomicU32,
    bytes: [AtomicU8; N],
}

impl<const N: usize> Ring<N> {
    #[allow(clippy::new_without_default)] // for a static
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two()) };
        Self { put: AtomicU32::new(0), taken: AtomicU32::new(0), bytes: [const { AtomicU8::new(0) }; N] }
    }

    /// Puts bytes; gives how many there was no room for.
    pub fn put(&self, bytes: &[u8]) -> u32 {
        let put = self.put.load(Ordering::Relaxed);
        let waiting = put.wrapping_sub(self.taken.load(Ordering::Acquire)) as usize;
        let room = N.saturating_sub(waiting).min(bytes.len());
        for (&byte, at) in bytes.iter().take(room).zip(put as usize..) {
            if let Some(place) = self.bytes.get(at % N) {
                place.store(byte, Ordering::Relaxed);
            }
        }
        self.put.store(put.wrapping_add(room as u32), Ordering::Release);
        (bytes.len() - room) as u32
    }

    /// How many bytes have been put, modulo 2¹⁶: a mark up to which [`Self::take`] takes.
    pub fn mark(&self) -> u16 {
        self.put.load(Ordering::Acquire) as u16
    }

    /// Takes the bytes that were put before a mark, as many as there is room for in `place`; gives those.
    pub fn take<'a>(&self, mark: u16, place: &'a mut [u8]) -> &'a [u8] {
        let taken = self.taken.load(Ordering::Relaxed);
        let waiting = self.put.load(Ordering::Acquire).wrapping_sub(taken) as usize;
        let before = usize::from(mark.wrapping_sub(taken as u16));
        let room = place.len();
        let place = place.get_mut(..waiting.min(before).min(room)).unwrap_or_default();
        for (byte, at) in place.iter_mut().zip(taken as usize..) {
            if let Some(waiting) = self.bytes.get(at % N) {
                *byte = waiting.load(Ordering::Relaxed);
            }
        }
        self.taken.store(taken.wrapping_add(place.len() as u32), Ordering::Release);
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_in_their_order_and_what_has_no_room_is_told() {
        let ring = Ring::<4>::new();
        let mut place = [0; 3];
        assert_eq!(ring.take(ring.mark(), &mut place), []);
        assert_eq!(ring.put(&[1, 2, 3, 4, 5, 6]), 2);
        assert_eq!(ring.take(ring.mark(), &mut place), [1, 2, 3]);
        assert_eq!(ring.put(&[7, 8]), 0);
        assert_eq!(ring.take(ring.mark(), &mut place), [4, 7, 8]);
        assert_eq!(ring.take(ring.mark(), &mut place), []);
    }

    #[test]
    fn what_came_after_a_mark_waits() {
        let ring = Ring::<8>::new();
        ring.put(&[1, 2, 3]);
        let mark = ring.mark();
        ring.put(&[4, 5]);
        let mut place = [0; 2];
        assert_eq!(ring.take(mark, &mut place), [1, 2]);
        assert_eq!(ring.take(mark, &mut place), [3]);
        assert_eq!(ring.take(mark, &mut place), []);
        assert_eq!(ring.take(ring.mark(), &mut place), [4, 5]);
    }

    #[test]
    fn the_counts_wrap() {
        let ring = Ring::<4>::new();
        ring.put.store(u32::MAX - 1, Ordering::Relaxed);
        ring.taken.store(u32::MAX - 1, Ordering::Relaxed);
        assert_eq!(ring.put(&[1, 2, 3]), 0);
        let mark = ring.mark();
        assert_eq!((mark, ring.put(&[4, 5])), (1, 1));
        assert_eq!(ring.take(mark, &mut [0; 8]), [1, 2, 3]);
        assert_eq!(ring.take(ring.mark(), &mut [0; 8]), [4]);
    }
}

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
        let (to_end, from_start) = self.places(put);
        let (first, second) = bytes.split_at(room).0.split_at(room.min(to_end.len()));
        let store = |(place, &byte): (&AtomicU8, &u8)| place.store(byte, Ordering::Relaxed);
        to_end.iter().zip(first).for_each(store);
        from_start.iter().zip(second).for_each(store);
        self.put.store(put.wrapping_add(room as u32), Ordering::Release);
        (bytes.len() - room) as u32
    }

    /// The places of bytes from this number on: to the ring's end, and from its beginning.
    #[inline(always)]
    fn places(&self, number: u32) -> (&[AtomicU8], &[AtomicU8]) {
        let (from_start, to_end) = self.bytes.split_at(number as usize % N);
        (to_end, from_start)
    }

    /// How many bytes have been put, modulo 2¹⁶: a mark up to which [`Self::take`] takes.
    pub fn mark(&self) -> u16 {
        self.put.load(Ordering::Acquire) as u16
    }

    /// Whether nothing waits that was put before a mark.
    pub fn is_empty(&self, mark: u16) -> bool {
        mark == self.taken.load(Ordering::Relaxed) as u16
    }

    /// Takes the bytes that were put before a mark, as many as there is room for in `place`; gives how many.
    pub fn take(&self, mark: u16, place: &mut [u8]) -> usize {
        let taken = self.taken.load(Ordering::Relaxed);
        let waiting = self.put.load(Ordering::Acquire).wrapping_sub(taken) as usize;
        let before = usize::from(mark.wrapping_sub(taken as u16));
        let length = waiting.min(before).min(place.len());
        let (to_end, from_start) = self.places(taken);
        let (first, second) = place.split_at_mut(length).0.split_at_mut(length.min(to_end.len()));
        let load = |(byte, place): (&mut u8, &AtomicU8)| *byte = place.load(Ordering::Relaxed);
        first.iter_mut().zip(to_end).for_each(load);
        second.iter_mut().zip(from_start).for_each(load);
        self.taken.store(taken.wrapping_add(length as u32), Ordering::Release);
        length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is taken up to a mark.
    fn taken<'a, const N: usize>(ring: &Ring<N>, mark: u16, place: &'a mut [u8]) -> &'a [u8] {
        let length = ring.take(mark, place);
        &place[..length]
    }

    #[test]
    fn bytes_come_out_in_their_order_and_what_has_no_room_is_told() {
        let ring = Ring::<4>::new();
        let mut place = [0; 3];
        assert_eq!(taken(&ring, ring.mark(), &mut place), []);
        assert_eq!(ring.put(&[1, 2, 3, 4, 5, 6]), 2);
        assert_eq!(taken(&ring, ring.mark(), &mut place), [1, 2, 3]);
        assert_eq!(ring.put(&[7, 8]), 0);
        assert_eq!(taken(&ring, ring.mark(), &mut place), [4, 7, 8]);
        assert_eq!(taken(&ring, ring.mark(), &mut place), []);
    }

    #[test]
    fn what_came_after_a_mark_waits() {
        let ring = Ring::<8>::new();
        ring.put(&[1, 2, 3]);
        let mark = ring.mark();
        ring.put(&[4, 5]);
        let mut place = [0; 2];
        assert_eq!(taken(&ring, mark, &mut place), [1, 2]);
        assert!(!ring.is_empty(mark));
        assert_eq!(taken(&ring, mark, &mut place), [3]);
        assert!(ring.is_empty(mark) && !ring.is_empty(ring.mark()));
        assert_eq!(taken(&ring, mark, &mut place), []);
        assert_eq!(taken(&ring, ring.mark(), &mut place), [4, 5]);
    }

    #[test]
    fn the_counts_wrap() {
        let ring = Ring::<4>::new();
        ring.put.store(u32::MAX - 1, Ordering::Relaxed);
        ring.taken.store(u32::MAX - 1, Ordering::Relaxed);
        assert_eq!(ring.put(&[1, 2, 3]), 0);
        let mark = ring.mark();
        assert_eq!((mark, ring.put(&[4, 5])), (1, 1));
        assert_eq!(taken(&ring, mark, &mut [0; 8]), [1, 2, 3]);
        assert_eq!(taken(&ring, ring.mark(), &mut [0; 8]), [4]);
    }
}

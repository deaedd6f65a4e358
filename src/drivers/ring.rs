//! Bytes from a line to a task, or from a task to a line, without locks: one side puts, the other takes.
//!
//! Not the queue of heapless: this one is a static that both sides share by reference, a DMA controller may be either side, and
//! it is emptied in parts. Of what comes, which cannot wait, new bytes are put over the oldest ones; what goes out is put only where
//! there is room for it.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Room for N bytes, a power of two.
#[derive(Debug)]
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

    /// Puts bytes, over the oldest ones where there is no room, as a DMA controller does.
    pub fn put(&self, bytes: &[u8]) {
        let end = self.put.load(Ordering::Relaxed).wrapping_add(bytes.len() as u32);
        let last = bytes.get(bytes.len().saturating_sub(N)..).unwrap_or_default();
        let (to_end, from_start) = self.places(end.wrapping_sub(last.len() as u32));
        to_end.iter().chain(from_start).zip(last).for_each(|(place, &byte)| place.store(byte, Ordering::Relaxed));
        self.put.store(end, Ordering::Release);
    }

    /// Puts bytes where there is room for all of them; gives whether there was.
    pub fn put_whole(&self, bytes: &[u8]) -> bool {
        let waiting = self.put.load(Ordering::Relaxed).wrapping_sub(self.taken.load(Ordering::Acquire));
        let fits = bytes.len() <= N.saturating_sub(waiting as usize);
        if fits {
            self.put(bytes);
        }
        fits
    }

    /// The oldest bytes that wait, as far as their places follow each other: for who sends them from there. No others are put there
    /// before [`Self::free`].
    pub fn waiting(&self) -> &[AtomicU8] {
        let taken = self.taken.load(Ordering::Relaxed);
        let waiting = self.put.load(Ordering::Acquire).wrapping_sub(taken) as usize;
        let (to_end, _) = self.places(taken);
        to_end.get(..waiting).unwrap_or(to_end)
    }

    /// So many of the oldest bytes are out.
    pub fn free(&self, bytes: usize) {
        self.taken.store(self.taken.load(Ordering::Relaxed).wrapping_add(bytes as u32), Ordering::Release);
    }

    /// The bytes' places: for a DMA controller, which writes to them in their order, from the first one on, round and round. It alone
    /// puts bytes then, and [`Self::come_to`] tells how far it has come.
    pub fn all_places(&self) -> &[AtomicU8; N] {
        &self.bytes
    }

    /// The controller's next byte is for the place of this number. It has gone around less than once since this was called last; were it
    /// not so, because the processor stood still, the bytes of whole rounds would be lost and not be counted here.
    pub fn come_to(&self, place: usize) {
        let put = self.put.load(Ordering::Relaxed);
        let came = place.wrapping_sub(put as usize) % N;
        self.put.store(put.wrapping_add(came as u32), Ordering::Release);
    }

    /// The places of bytes from this number on: to the ring's end, and from its beginning.
    #[inline(always)]
    fn places(&self, number: u32) -> (&[AtomicU8], &[AtomicU8]) {
        let (from_start, to_end) = self.bytes.split_at(number as usize % N);
        (to_end, from_start)
    }

    /// How many bytes have been put, modulo 2³²: a mark up to which [`Self::take`] takes.
    pub fn mark(&self) -> u32 {
        self.put.load(Ordering::Acquire)
    }

    /// Whether nothing waits that was put before a mark.
    pub fn is_empty(&self, mark: u32) -> bool {
        mark.wrapping_sub(self.taken.load(Ordering::Relaxed)).cast_signed() <= 0
    }

    /// Takes the bytes that were put before a mark, as many as there is room for in `place`. Gives how many, and how many had been
    /// overwritten before they were taken, those after the mark included.
    ///
    /// A byte that is overwritten while it is taken, or by a controller after [`Self::come_to`], is taken as it is: the frame's check sum
    /// tells.
    pub fn take(&self, mark: u32, place: &mut [u8]) -> (usize, u32) {
        let taken = self.taken.load(Ordering::Relaxed);
        let waiting = self.put.load(Ordering::Acquire).wrapping_sub(taken);
        let overwritten = waiting.saturating_sub(N as u32);
        let from = taken.wrapping_add(overwritten);
        let before = mark.wrapping_sub(from);
        // Otherwise all that came before the mark was overwritten.
        let length = if before <= waiting - overwritten { place.len().min(before as usize) } else { 0 };
        let (to_end, from_start) = self.places(from);
        let load = |(byte, place): (&mut u8, &AtomicU8)| *byte = place.load(Ordering::Relaxed);
        let (first, second) = place.split_at_mut(length).0.split_at_mut(length.min(to_end.len()));
        first.iter_mut().zip(to_end).for_each(load);
        second.iter_mut().zip(from_start).for_each(load);
        self.taken.store(from.wrapping_add(length as u32), Ordering::Release);
        (length, overwritten)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    /// What is taken up to a mark, and what had been overwritten.
    fn taken<const N: usize>(ring: &Ring<N>, mark: u32, room: usize) -> (Vec<u8>, u32) {
        let mut place = std::vec![0; room];
        let (length, overwritten) = ring.take(mark, &mut place);
        (place[..length].to_vec(), overwritten)
    }

    #[test]
    fn bytes_come_out_in_their_order() {
        let ring = Ring::<4>::new();
        assert_eq!(taken(&ring, ring.mark(), 3), (Vec::new(), 0));
        ring.put(&[1, 2, 3, 4]);
        assert_eq!(taken(&ring, ring.mark(), 3), ([1, 2, 3].to_vec(), 0));
        ring.put(&[5, 6]);
        assert_eq!(taken(&ring, ring.mark(), 3), ([4, 5, 6].to_vec(), 0));
        assert_eq!(taken(&ring, ring.mark(), 3), (Vec::new(), 0));
    }

    #[test]
    fn the_oldest_are_overwritten_and_counted_once() {
        let ring = Ring::<4>::new();
        ring.put(&[1, 2, 3]);
        ring.put(&[4, 5, 6]);
        assert_eq!(taken(&ring, ring.mark(), 3), ([3, 4, 5].to_vec(), 2));
        assert_eq!(taken(&ring, ring.mark(), 3), ([6].to_vec(), 0));
        ring.put(&[7, 8, 9, 10, 11, 12, 13, 14, 15]);
        assert_eq!(taken(&ring, ring.mark(), 8), ([12, 13, 14, 15].to_vec(), 5));
    }

    #[test]
    fn what_came_after_a_mark_waits() {
        let ring = Ring::<8>::new();
        ring.put(&[1, 2, 3]);
        let mark = ring.mark();
        ring.put(&[4, 5]);
        assert_eq!(taken(&ring, mark, 2).0, [1, 2]);
        assert!(!ring.is_empty(mark));
        assert_eq!(taken(&ring, mark, 2).0, [3]);
        assert!(ring.is_empty(mark) && !ring.is_empty(ring.mark()));
        assert_eq!(taken(&ring, mark, 2).0, []);
        assert_eq!(taken(&ring, ring.mark(), 2).0, [4, 5]);
    }

    #[test]
    fn what_came_after_a_mark_waits_where_all_before_it_was_overwritten() {
        let ring = Ring::<4>::new();
        ring.put(&[1, 2]);
        let mark = ring.mark();
        ring.put(&[3, 4, 5, 6, 7]);
        assert!(!ring.is_empty(mark));
        assert_eq!(taken(&ring, mark, 8), (Vec::new(), 3));
        assert!(ring.is_empty(mark));
        assert_eq!(taken(&ring, ring.mark(), 8), ([4, 5, 6, 7].to_vec(), 0));
    }

    #[test]
    fn the_counts_wrap() {
        let ring = Ring::<4>::new();
        ring.put.store(u32::MAX - 1, Ordering::Relaxed);
        ring.taken.store(u32::MAX - 1, Ordering::Relaxed);
        ring.put(&[1, 2, 3]);
        let mark = ring.mark();
        ring.put(&[4]);
        assert!(mark == 1 && !ring.is_empty(mark));
        assert_eq!(taken(&ring, mark, 8), ([1, 2, 3].to_vec(), 0));
        assert_eq!(taken(&ring, ring.mark(), 8), ([4].to_vec(), 0));
    }

    #[test]
    fn what_has_no_room_is_not_put_and_what_waits_is_sent_from_its_place() {
        let ring = Ring::<4>::new();
        let waiting = || ring.waiting().iter().map(|byte| byte.load(Ordering::Relaxed)).collect::<Vec<u8>>();
        assert!(waiting().is_empty() && ring.put_whole(&[1, 2, 3]) && !ring.put_whole(&[4, 5]) && ring.put_whole(&[6]));
        assert_eq!(waiting(), [1, 2, 3, 6]);
        ring.free(2);
        assert!(ring.put_whole(&[7, 8]) && !ring.put_whole(&[9]) && ring.put_whole(&[]));
        // To the ring's end, and from its beginning.
        assert_eq!(waiting(), [3, 6]);
        ring.free(2);
        assert_eq!(waiting(), [7, 8]);
        ring.free(2);
        assert!(waiting().is_empty());
    }

    /// A controller's bytes, by hand: each comes to the place that follows.
    #[test]
    fn a_controller_is_followed_round_and_round() {
        let ring = Ring::<4>::new();
        let writes = |from: usize, bytes: &[u8]| {
            let places = ring.all_places().iter().cycle().skip(from);
            places.zip(bytes).for_each(|(place, &byte)| place.store(byte, Ordering::Relaxed));
        };
        writes(0, &[1, 2, 3]);
        ring.come_to(3);
        assert_eq!(taken(&ring, ring.mark(), 8), ([1, 2, 3].to_vec(), 0));
        ring.come_to(3);
        assert_eq!(taken(&ring, ring.mark(), 8), (Vec::new(), 0));
        writes(3, &[4, 5]);
        ring.come_to(1);
        assert_eq!(taken(&ring, ring.mark(), 8), ([4, 5].to_vec(), 0));
        // To its very end, where the controller begins anew.
        writes(1, &[6, 7, 8]);
        ring.come_to(4);
        assert_eq!(taken(&ring, ring.mark(), 8), ([6, 7, 8].to_vec(), 0));
        writes(0, &[9, 10, 11]);
        ring.come_to(3);
        writes(3, &[12, 13]);
        ring.come_to(1);
        assert_eq!(taken(&ring, ring.mark(), 8), ([10, 11, 12, 13].to_vec(), 1));
    }

    /// A controller as on the chip: its counter of the places that are left begins anew at once. Looked at after 0 to 15 bytes, and often
    /// right when it has begun anew, no byte is counted that was not put.
    #[test]
    fn a_million_rounds_have_no_byte_too_many() {
        const PLACES: u64 = 16;
        let ring = Ring::<{ PLACES as usize }>::new();
        let (mut came, mut random) = (0_u64, 1_u64);
        while came < PLACES * 1_000_000 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let to_end = PLACES - came % PLACES;
            came += if random >> 63 == 0 && to_end < PLACES { to_end } else { (random >> 32) % PLACES };
            let left = PLACES - came % PLACES;
            ring.come_to((PLACES - left) as usize);
            assert_eq!(u64::from(ring.mark()), came & u64::from(u32::MAX));
        }
    }
}

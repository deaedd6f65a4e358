//! Where the dwells of a fix are kept.

use heapless::Vec;

use super::dwell::DwellSummary;

/// Where the dwells of a fix are kept: on a board in a fixed place, on a host where there is room.
pub trait Dwells {
    /// `false`: there is no room.
    fn push(&mut self, dwell: DwellSummary) -> bool;
    fn as_slice(&self) -> &[DwellSummary];
    fn get_mut(&mut self, number: usize) -> Option<&mut DwellSummary>;
    /// Puts one in the place of two in a row, the first of them by its number.
    fn replace_two(&mut self, number: usize, by: DwellSummary) {
        if let Some(place) = self.get_mut(number) {
            *place = by;
        }
        let mut at = 0..;
        self.retain(|_| at.next() != Some(number + 1));
    }
    /// Keeps those for which `keep` says so.
    fn retain(&mut self, keep: impl FnMut(&DwellSummary) -> bool);
}

impl<const N: usize> Dwells for Vec<DwellSummary, N> {
    fn push(&mut self, dwell: DwellSummary) -> bool {
        Vec::push(self, dwell).is_ok()
    }

    fn as_slice(&self) -> &[DwellSummary] {
        self
    }

    fn get_mut(&mut self, number: usize) -> Option<&mut DwellSummary> {
        self.as_mut_slice().get_mut(number)
    }

    fn retain(&mut self, keep: impl FnMut(&DwellSummary) -> bool) {
        Vec::retain(self, keep);
    }
}

#[cfg(test)]
impl Dwells for std::vec::Vec<DwellSummary> {
    fn push(&mut self, dwell: DwellSummary) -> bool {
        std::vec::Vec::push(self, dwell);
        true
    }

    fn as_slice(&self) -> &[DwellSummary] {
        self
    }

    fn get_mut(&mut self, number: usize) -> Option<&mut DwellSummary> {
        self.as_mut_slice().get_mut(number)
    }

    fn retain(&mut self, keep: impl FnMut(&DwellSummary) -> bool) {
        std::vec::Vec::retain(self, keep);
    }
}

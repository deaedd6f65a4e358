//! Where the dwells of a fix are kept.

use heapless::Vec;

use super::dwell::DwellSummary;

/// Where the dwells of a fix are kept: on a board in a fixed place, on a host where there is room.
pub trait Dwells {
    /// `false`: there is no room.
    fn push(&mut self, dwell: DwellSummary) -> bool;
    fn as_slice(&self) -> &[DwellSummary];
    fn get_mut(&mut self, number: usize) -> Option<&mut DwellSummary>;
    /// Joins the part of a dwell with this number and the one after it.
    fn join_next(&mut self, number: usize) {
        let Some(&next) = self.as_slice().get(number + 1) else { return };
        if let Some(own) = self.get_mut(number) {
            *own = own.joined(&next);
        }
        let mut numbers = 0..;
        self.retain(|_| numbers.next() != Some(number + 1));
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

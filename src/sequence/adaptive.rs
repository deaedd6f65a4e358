//! An adaptive fix: when it moves, and when it ends.
//!
//! Two short dwells give a coarse azimuth; then the axis points east and west in turn, where the azimuth's sensitivity is greatest:
//! a block of three dwells, ¼ ½ ¼ of the time, in which a linear drift cancels, or of two where there is no time for that. After a
//! block the solution's own sigma says whether there must be another. A second counts as soon as it is quiet, whether its gate has
//! passed or not: the gates still decide whether the fix goes on.

use crate::index::IndexSettings;
use crate::units::DEG_PER_RAD;

/// Quiet seconds that are enough for the coarse azimuth's second dwell.
pub const COARSE_SECONDS: u16 = 2;
/// Dwells that a second which is not quiet may end before its gate has passed; then the gates are waited for.
const MOST_INTERRUPTIONS: u8 = 6;
/// Shortest time for three dwells of a block, seconds.
const THREE_DWELLS_S: f64 = 90.0;
/// A block shorter than this is not worth its moves, seconds.
const LEAST_BLOCK_S: f64 = 15.0;
/// Blocks end after so many dwells at most, whatever sigma is.
const MOST_POSITIONS: u8 = 17;
/// What is planned is more than what is needed by this share: the noise that is found may be greater than the declared one.
const MARGIN: f64 = 1.05;
/// From the last step of a move to the beginning of the next whole second and the one after, which is the first to be quiet.
const SETTLING_S: f64 = 1.7;

/// A fix that goes on until its sigma is small enough.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    accuracy_deg: f64,
    /// It ends here at the latest, whatever its sigma is.
    limit_s: f64,
    /// End of the block under way, and the number of its last dwell.
    end_s: f64,
    last: u8,
    /// It has three dwells.
    three: bool,
    /// End of the dwell under way.
    dwell_end_s: f64,
    /// Where the gyro is turned to, degrees.
    pub target_deg: f64,
    /// The dwell under way has seconds of before its gate passed: how many.
    pub early: u16,
    interruptions: u8,
    /// At this position a second was not quiet: its gate is waited for.
    waits: bool,
}

impl Adaptive {
    /// For a standard deviation of the azimuth, degrees; it must end before `limit_s`.
    pub fn new(accuracy_deg: f64, limit_s: f64) -> Self {
        Self {
            accuracy_deg,
            limit_s,
            end_s: limit_s,
            last: 0,
            three: false,
            dwell_end_s: f64::INFINITY,
            target_deg: 0.0,
            early: 0,
            interruptions: 0,
            waits: false,
        }
    }

    /// A second may be taken before its gate has passed.
    pub fn takes_early(&self) -> bool {
        !self.waits && self.interruptions < MOST_INTERRUPTIONS
    }

    /// The gyro rings after its move: short dwells between seconds that are not quiet would hold a part of the ringing each.
    pub fn wait(&mut self) {
        self.waits = true;
    }

    /// A second was not quiet. Whether a dwell was under way, which it ends.
    pub fn interrupted(&mut self) -> bool {
        let under_way = core::mem::take(&mut self.early) > 0;
        self.interruptions = self.interruptions.saturating_add(under_way.into());
        under_way
    }

    pub fn dwell_is_over(&self, t_s: f64) -> bool {
        t_s >= self.dwell_end_s
    }

    /// A dwell without an end of its own begins.
    pub fn begin_coarse(&mut self) {
        (self.early, self.dwell_end_s, self.waits) = (0, f64::INFINITY, false);
    }

    /// Plans the first block, from dwell `position` on, after a move of `way_deg`: as long as a gyro with this noise of a second,
    /// °/h, needs at this horizontal Earth rate, if its axis always points east or west.
    pub fn begin(
        &mut self,
        position: u8,
        t_s: f64,
        way_deg: f64,
        index: &IndexSettings,
        [noise_deg_h, north_deg_h]: [f64; 2],
    ) {
        let ratio = DEG_PER_RAD * noise_deg_h / (north_deg_h * self.accuracy_deg);
        self.block(position, t_s, way_deg, index, MARGIN * ratio * ratio);
    }

    /// The block is over, after `measured_s` of measuring in all, with this sigma: plans another, from dwell `position` on after half
    /// a turn. `false`: sigma is small enough, or there is no time.
    pub fn go_on(
        &mut self,
        position: u8,
        t_s: f64,
        index: &IndexSettings,
        measured_s: f64,
        sigma_deg: Option<f64>,
    ) -> bool {
        let room_s = self.limit_s - t_s - 2.0 * move_s(180.0, index);
        if room_s < LEAST_BLOCK_S || position >= MOST_POSITIONS {
            return false;
        }
        let more_s = match sigma_deg.map(|sigma_deg| sigma_deg / self.accuracy_deg) {
            Some(ratio) if ratio <= 1.0 => return false,
            Some(ratio) => MARGIN * measured_s * (ratio * ratio - 1.0),
            None => room_s,
        };
        self.block(position, t_s, 180.0, index, more_s.max(LEAST_BLOCK_S));
        true
    }

    fn block(&mut self, position: u8, t_s: f64, way_deg: f64, index: &IndexSettings, measuring_s: f64) {
        let moved_s = t_s + move_s(way_deg, index);
        let room_s = (self.limit_s - moved_s).min(measuring_s + 2.0 * move_s(180.0, index));
        self.three = room_s >= THREE_DWELLS_S;
        let moves = if self.three { 2 } else { 1 };
        self.last = position.saturating_add(moves);
        self.end_s = (moved_s + measuring_s + f64::from(moves) * move_s(180.0, index)).min(self.limit_s);
        self.begin_dwell(position, moved_s, index);
    }

    /// The dwell of this number begins after half a turn; `false`: the block is over.
    pub fn next(&mut self, position: u8, t_s: f64, index: &IndexSettings) -> bool {
        if position > self.last {
            return false;
        }
        self.begin_dwell(position, t_s + move_s(180.0, index), index);
        true
    }

    /// The dwell's part of what is left: its own weight over those of it and its successors; the weights are 1, 2, 1 or 1, 1.
    fn begin_dwell(&mut self, position: u8, begin_s: f64, index: &IndexSettings) {
        let moves = self.last.saturating_sub(position);
        let share = match moves {
            0 => 1.0,
            1 if self.three => 2.0 / 3.0,
            1 => 0.5,
            _ => 0.25,
        };
        let left_s = self.end_s - begin_s - f64::from(moves) * move_s(180.0, index);
        (self.early, self.waits) = (0, false);
        self.dwell_end_s = begin_s + share * left_s.max(0.0);
    }

    /// Seconds until the block ends.
    pub fn to_go_s(&self, t_s: f64) -> f64 {
        (self.end_s - t_s).max(0.0)
    }
}

/// Duration of a move until the first second that can count.
fn move_s(way_deg: f64, index: &IndexSettings) -> f64 {
    let ramp_s = index.speed_deg_s / index.acceleration_deg_s2;
    way_deg.abs() / index.speed_deg_s + ramp_s + SETTLING_S
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 30 °/s and 60 °/s²: half a turn takes 6 + 0.5 + 1.7 s.
    const TURN_S: f64 = 8.2;

    #[test]
    fn a_block_by_hand() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.03, 1000.0);
        // 0.09 °/h over 12 °/h is 0.0075 rad, 0.4297°; over 0.03°, squared: 205.2 s, and a twentieth more: 215.4 s.
        plan.begin(2, 20.0, 0.0, &index, [0.09, 12.0]);
        let (begin_s, measuring_s) = (20.0 + 0.5 + 1.7, 215.43);
        let ends_s = [0.25, 0.75, 1.0].map(|share| begin_s + share * measuring_s);
        assert!((plan.dwell_end_s - ends_s[0]).abs() < 0.1, "{plan:?}");
        assert!(plan.next(3, ends_s[0], &index) && (plan.dwell_end_s - ends_s[1] - TURN_S).abs() < 0.1, "{plan:?}");
        assert!(plan.next(4, ends_s[1] + TURN_S, &index), "{plan:?}");
        assert!((plan.dwell_end_s - ends_s[2] - 2.0 * TURN_S).abs() < 0.1 && !plan.next(5, 300.0, &index), "{plan:?}");
        // Sigma is a fifth too large: 0.44 of 220 s, and a twentieth more; a quarter of it first.
        assert!(plan.go_on(5, 300.0, &index, 220.0, Some(0.036)));
        assert!((plan.dwell_end_s - (300.0 + TURN_S + 0.25 * 101.6)).abs() < 0.1, "{plan:?}");
        assert!(!plan.go_on(7, 400.0, &index, 320.0, Some(0.0299)) && !plan.go_on(7, 970.0, &index, 320.0, None));
    }

    #[test]
    fn the_limit_ends_it() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.001, 60.0);
        plan.begin(2, 20.0, 0.0, &index, [0.09, 12.0]);
        // Two dwells: 60 − 22.2 − 8.2 = 29.6 s between them.
        assert!((plan.dwell_end_s - 37.0).abs() < 0.1 && plan.next(3, 37.0, &index), "{plan:?}");
        assert!(plan.dwell_end_s == 60.0 && !plan.go_on(4, 60.0, &index, 30.0, Some(0.1)), "{plan:?}");
    }
}

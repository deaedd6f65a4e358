//! The steps of all moves, against the encoder.
//!
//! Gear and coupling have play: turned one way the spindle stands behind the steps by one part of it, turned the other way by the rest, and before its
//! first move it stood somewhere between. So what a move is behind the steps that were made since the first one began is never less than nothing, and
//! the same after every move the same way. An encoder that slips while the index turns changes it from there on, as does a spindle that slips, and a
//! motor that loses steps: then the readings are right. What is taken for play is a slip in the first move one way that looks like it and is followed
//! by none the other way.
//!
//! The rates tell less. A slip by δ before the last share f of a rotation turns its azimuth by f δ, and the azimuths before and after it differ by δ. With σ
//! the azimuth's sigma by noise, that difference has the sigma σ/√(f (1 − f)): where the azimuth is off by k σ, the difference is k √((1 − f)/f) of its
//! own sigmas, for 4.4 σ only 1.9 where f is 0.84. In a fix that begins after the slip there is no difference at all.

use super::turn::beyond_deg;
use crate::sensing::index::{IndexSettings, MotorCommand};

/// The steps since power-up, or since a move that did not end.
#[derive(Clone, Copy, Debug, Default)]
pub struct Steps {
    /// What the encoder read before the first of them, degrees, unwrapped.
    zero_deg: Option<f64>,
    microsteps: i64,
    /// The last move, or that under way, goes counter-clockwise.
    counter_clockwise: bool,
    under_way: bool,
    /// By how much the index was behind its steps when it had first been turned counter-clockwise, and clockwise, degrees.
    behind_deg: Option<f64>,
    behind_clockwise_deg: Option<f64>,
}

impl Steps {
    /// A move begins where the encoder reads this, degrees, unwrapped. After one that did not end nobody knows how many steps it made.
    pub fn begin(&mut self, index_deg: f64, command: MotorCommand) {
        let MotorCommand::Turn { microsteps } = command else { return };
        if self.under_way {
            self.forget();
        }
        self.zero_deg.get_or_insert(index_deg);
        self.microsteps += i64::from(microsteps);
        (self.counter_clockwise, self.under_way) = (microsteps > 0, true);
    }

    /// The motor made other steps than these.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The move has ended where the encoder reads this, degrees, unwrapped. Whether the steps contradict it.
    ///
    /// Both ends have the encoder's sigma: their difference is beyond the limit, 7/√2 = 4.95 of its sigmas, by noise in 7·10⁻⁷ of all comparisons, and
    /// to one side in half of them. That is 1.1·10⁻⁶ a move, 2·10⁻⁵ a rotation of 20 passes, and 1.3·10⁻⁴ one of 120, the most there are.
    pub fn ended(&mut self, index_deg: f64, settings: &IndexSettings) -> bool {
        self.under_way = false;
        let Some(zero_deg) = self.zero_deg else { return false };
        let ahead_deg = index_deg - zero_deg - self.microsteps as f64 / settings.microsteps_per_deg();
        let (behind_deg, first) = match self.counter_clockwise {
            true => (-ahead_deg, &mut self.behind_deg),
            false => (ahead_deg, &mut self.behind_clockwise_deg),
        };
        let limit_deg = beyond_deg(settings);
        let first_deg = *first.get_or_insert(behind_deg);
        behind_deg < -limit_deg || (behind_deg - first_deg).abs() > limit_deg
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Which moves are contradicted: from a reading of 0°, by so many microsteps of 0.01° to these readings, degrees. The limit is 0.14°.
    fn told(moves: &[(i32, f64)]) -> Vec<bool> {
        let (mut steps, mut index_deg) = (Steps::default(), 0.0);
        let is_contradicted = |&(microsteps, end_deg): &(i32, f64)| {
            steps.begin(index_deg, MotorCommand::Turn { microsteps });
            index_deg = end_deg;
            steps.ended(end_deg, &IndexSettings::default())
        };
        moves.iter().map(is_contradicted).collect()
    }

    /// 0.4° of play with the spindle in its middle, then at one of its ends: it stands 0.2° behind its steps, then none and 0.4°.
    #[test]
    fn play_is_no_slip() {
        assert_eq!(
            told(&[(-400, -3.8), (35_780, 353.6), (-35_760, -3.6), (35_760, 353.6), (-9000, 264.0)]),
            [false; 5]
        );
        assert_eq!(told(&[(-400, -4.0), (35_800, 353.6), (-35_760, -3.6), (9000, 86.0)]), [false; 4]);
    }

    /// The encoder reads 0.2° too little from the middle of the first pass on, which may be play, and on the way back, where the motor ends at −3.8°, it
    /// went 0.2° farther than its steps, which is none. 0.23° too much from the second pass on: that pass ends 0.23° before the place where the move
    /// the same way before it did, and the next one 0.23° beyond its steps. 0.3° too little from the third of four moves the same way on.
    #[test]
    fn a_slip_is_told_by_the_moves_after_it() {
        assert_eq!(
            told(&[(-400, -4.0), (35_800, 353.8), (-35_780, -4.0), (35_800, 354.0)]),
            [false, false, true, false]
        );
        assert_eq!(
            told(&[(-400, -4.0), (35_800, 354.0), (-35_800, -3.77), (35_777, 354.0)]),
            [false, false, true, true]
        );
        assert_eq!(told(&[(9000, 90.0), (9000, 180.0), (9000, 269.7), (8500, 354.7)]), [false, false, true, true]);
    }

    /// Of steps that the motor loses evenly, 0.3° a pass, the way back loses as many; in moves the same way, 0.06° and 0.1° each, they add up.
    #[test]
    fn lost_steps_are_told_where_they_add_up() {
        assert_eq!(told(&[(-400, -4.0), (35_800, 353.7), (-35_770, -3.7), (35_770, 353.7)]), [false; 4]);
        assert_eq!(told(&[(9000, 89.94), (9006, 179.94), (9006, 269.94)]), [false; 3]);
        assert_eq!(told(&[(9000, 89.9), (9010, 179.9), (9010, 269.9)]), [false, false, true]);
    }

    /// A move of 90° that a command stops half-way, and the next one from there.
    #[test]
    fn a_move_that_did_not_end_is_forgotten() {
        let mut steps = Steps::default();
        steps.begin(0.0, MotorCommand::Turn { microsteps: 9000 });
        steps.begin(45.0, MotorCommand::Turn { microsteps: 9000 });
        assert!(!steps.ended(135.0, &IndexSettings::default()));
        steps.begin(135.0, MotorCommand::Turn { microsteps: 9000 });
        assert!(steps.ended(224.0, &IndexSettings::default()));
        steps.forget();
        assert!(!steps.ended(200.0, &IndexSettings::default()));
    }
}

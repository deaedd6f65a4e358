//! What the index has done: its winding, its last move, its moves by number.

use super::conditions::Conditions;
use crate::units::wrap_180_deg;

/// The index is at rest while it turns by less than this in a row, degrees.
pub const REST_DEG: f64 = 0.5;

/// Where the winding of a run begins, degrees: from here on a turn is taken off. Runs begin at a position, mostly a multiple of 45°, whose reading scatters to both sides: at
/// 0° the turn would be that of chance.
const WHOLE_TURN_FROM_DEG: f64 = 337.5;

/// Rows follow each other where the middle of one is less than so many of its lengths behind that of the one before.
const LONGEST_STEP: f64 = 1.5;

/// The first rows of a recording, which may begin while the index turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Beginning {
    /// There is one row, or none.
    #[default]
    One,
    /// The index turned by this from the mean of the first row to that of the second, degrees.
    Turned {
        way_deg: f64,
    },
    Over,
}

/// The index' history as far as effects depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Track {
    last_deg: Option<f64>,
    last_s: f64,
    moving: bool,
    beginning: Beginning,
    /// Unwrapped index angle, degrees, counter-clockwise positive; the first is in [−22.5°, 337.5°).
    pub winding_deg: f64,
    /// The first one of the run.
    pub begun_deg: f64,
    /// Seconds since the last move ended, or since the recording began.
    pub since_s: f64,
    /// Way of the last move, degrees, counter-clockwise positive; 0 before the first.
    pub travel_deg: f64,
    /// Rows within the last move; 0 where the recording leaves them out.
    pub turn_rows: f64,
    /// The row follows the one before without a gap.
    pub in_a_row: bool,
    /// Moves that have begun.
    pub number: f64,
    /// Turning rate over the row, °/s.
    pub turning_deg_s: f64,
    /// Moves that began in this row, by second.
    pub begun_per_s: f64,
    /// Seconds since the middle of the row before.
    pub step_s: f64,
    rest_began_s: f64,
    /// Rate as the gyro gave it in the last row at rest, °/h.
    pub rate_deg_h: f64,
}

impl Track {
    /// Takes the next second (or longer row).
    pub fn push(&mut self, conditions: &Conditions) {
        let start_s = conditions.t_s - 0.5 * conditions.seconds;
        let first = self.last_deg.is_none();
        self.step_s = if first { 0.0 } else { (conditions.t_s - self.last_s).max(0.0) };
        self.in_a_row = !first && self.step_s < LONGEST_STEP * conditions.seconds;
        self.last_s = conditions.t_s;
        self.begun_per_s = 0.0;
        self.turning_deg_s = 0.0;
        if let Some(direction) = conditions.index {
            let index_deg = direction.deg();
            match self.last_deg.replace(index_deg) {
                None => {
                    self.winding_deg = if index_deg < WHOLE_TURN_FROM_DEG { index_deg } else { index_deg - 360.0 };
                    self.begun_deg = self.winding_deg;
                    self.rest_began_s = start_s;
                }
                Some(last_deg) => self.turn(wrap_180_deg(index_deg - last_deg), start_s),
            }
        }
        if !self.moving {
            self.rate_deg_h = conditions.raw_rate_deg_h;
        }
        self.since_s = (conditions.t_s - self.rest_began_s).max(0.0);
    }

    fn turn(&mut self, way_deg: f64, start_s: f64) {
        self.winding_deg += way_deg;
        let step_s = self.step_s.max(f64::MIN_POSITIVE);
        self.turning_deg_s = way_deg / step_s;
        let moving = way_deg.abs() > REST_DEG;
        let turns = moving && self.in_a_row;
        self.beginning = match self.beginning {
            Beginning::One if turns => Beginning::Turned { way_deg },
            Beginning::Turned { way_deg: first_deg } if turns => {
                self.travel_deg += before_first_row_deg(first_deg, way_deg);
                Beginning::Over
            }
            _ => Beginning::Over,
        };
        if moving {
            if self.moving && self.in_a_row {
                // The row before was within the move.
                self.turn_rows += 1.0;
            }
            if !self.moving {
                self.turn_rows = 0.0;
                self.travel_deg = 0.0;
                self.number += 1.0;
                self.begun_per_s = 1.0 / step_s;
            }
            self.travel_deg += way_deg;
            // Where rows leave the move out, rest begins with this very row.
            self.rest_began_s = start_s;
        }
        self.moving = moving;
    }
}

/// Way of a move before the mean of the first row, degrees, from the ways between the means of the first three rows.
///
/// The index turns at one speed, by v a row, from u of a row before the end of the first row on. The mean of that row is v u²/2 beyond where it stood, and that of the second one,
/// through which it turns, v (u + 1/2): the first way is v (u + 1/2 − u²/2), the second one v. One that is shorter than the first has the end of the move in it; the first one
/// is then v, and the move began with the recording.
fn before_first_row_deg(first_deg: f64, second_deg: f64) -> f64 {
    let is_longer = first_deg * second_deg > 0.0 && second_deg.abs() > first_deg.abs();
    let (speed_deg, share) = if is_longer { (second_deg, first_deg / second_deg) } else { (first_deg, 1.0) };
    let turned = (1.0 - libm::sqrt(2.0 - 2.0 * share)).max(0.0);
    0.5 * speed_deg * turned * turned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensing::index::Direction;

    /// Recordings that begin while the index turns by 40° a row: with the move, which has its mean at 20° in the first row, or half a row later, with 5° = 40°/8; from rest in
    /// the first row; and of a move that is left out between the rows. What the third row tells is the way before the first.
    #[test]
    fn a_move_that_is_under_way_at_first_by_hand() {
        let travel_deg = |angles_deg: &[f64], spacing_s: f64| {
            let mut track = Track::default();
            for (row, index_deg) in angles_deg.iter().enumerate() {
                let (t_s, index) = (0.5 + spacing_s * row as f64, Some(Direction::of_deg(*index_deg)));
                track.push(&Conditions { t_s, seconds: 1.0, index, ..Conditions::default() });
            }
            track.travel_deg
        };
        let of = |angles_deg: &[f64]| travel_deg(angles_deg, 1.0);
        // A root of what is nothing but for rounding is 1e-8.
        assert!((of(&[20.0, 60.0, 100.0, 120.0, 120.0]) - 120.0).abs() < 1e-5);
        assert!((of(&[340.0, 300.0, 260.0, 240.0, 240.0]) + 120.0).abs() < 1e-5);
        assert!((of(&[5.0, 40.0, 80.0, 115.0, 120.0, 120.0]) - 120.0).abs() < 1e-9);
        assert!((of(&[0.0, 20.0, 60.0, 80.0, 80.0]) - 80.0).abs() < 1e-9);
        // It ends in the second row, after half of it: 17.5° of the 20° before the first mean are known.
        assert!((of(&[20.0, 55.0, 60.0, 60.0]) - 57.5).abs() < 1e-5);
        assert!((travel_deg(&[0.0, 90.0, 180.0], 30.0) - 180.0).abs() < 1e-9);
        assert!((of(&[10.0, 90.0, 90.0]) - 80.0).abs() < 1e-9);
    }

    /// Rest at 350°, a move over two rows to 10° and 80°, rest: 90° counter-clockwise through north, resting from 3 s on. It begins at −10°.
    #[test]
    fn a_move_through_zero() {
        let mut track = Track::default();
        for (t_s, index_deg) in [(0.5, 350.0), (1.5, 350.1), (2.5, 10.0), (3.5, 80.0), (4.5, 80.0), (5.5, 80.0)] {
            let index = Some(Direction::of_deg(index_deg));
            track.push(&Conditions { t_s, seconds: 1.0, index, ..Conditions::default() });
        }
        assert!((track.winding_deg - 80.0).abs() < 1e-9 && (track.travel_deg - 89.9).abs() < 1e-9, "{track:?}");
        assert_eq!((track.number, track.since_s, track.step_s), (1.0, 2.5, 1.0));
        assert_eq!((track.begun_deg, track.turn_rows), (-10.0, 1.0), "a row at 10 deg lies between the rests");
        assert!(track.turning_deg_s.abs() < 1e-9 && track.begun_per_s == 0.0);
    }

    /// A run that begins at 0° begins there whether its first reading is a little less or more.
    #[test]
    fn noise_does_not_turn_the_winding() {
        let winding_deg = |first_deg: f64| {
            let mut track = Track::default();
            for (t_s, index_deg) in [(0.5, first_deg), (1.5, 45.0), (2.5, 90.0)] {
                let index = Some(Direction::of_deg(index_deg));
                track.push(&Conditions { t_s, seconds: 1.0, index, ..Conditions::default() });
            }
            track.winding_deg
        };
        assert!((winding_deg(-0.01) - 90.0).abs() < 1e-9 && (winding_deg(0.01) - 90.0).abs() < 1e-9);
        assert!((winding_deg(330.0) - 450.0).abs() < 1e-9);
    }

    /// While the index turns the rate of the last second at rest is kept.
    #[test]
    fn the_rate_of_a_turn_is_not_taken() {
        let mut track = Track::default();
        let mut rate_after = |t_s, index_deg, raw_rate_deg_h| {
            let index = Some(Direction::of_deg(index_deg));
            track.push(&Conditions { t_s, raw_rate_deg_h, index, ..Conditions::default() });
            track.rate_deg_h
        };
        assert_eq!(
            [rate_after(0.5, 10.0, 7.0), rate_after(1.5, 40.0, 900.0), rate_after(2.5, 40.0, -3.0)],
            [7.0, 7.0, -3.0]
        );
    }
}

//! Watches the index angle while the motor stands: the reading must stand too.
//!
//! A reading that jumps is a spindle that moved, or an encoder that slipped on it. The second in which it happens is known at
//! once; which of the two it was, only the gyro can say, from the dwells before and after: see [`super::solve`].

use crate::sensing::index::Direction;
use crate::units::wrap_180_deg;

/// Seconds that must agree before a jump is one. (A drive that turns never rests that long, and a slow rotation is
/// no slip.)
const STILL_SECONDS: u16 = 2;
/// How still, as a share of the least slip.
const STILL: f64 = 0.4;

/// The index angle since it came to rest.
#[derive(Clone, Copy, Debug)]
pub struct IndexWatch {
    /// Least change of the second's mean angle that is a slip, degrees.
    least_deg: f64,
    sum: Direction,
    seconds: u16,
    /// The last second was off by more than what is still and less than a slip: a slip may have begun late in it.
    suspect: bool,
}

impl IndexWatch {
    /// With the encoder's sigma at one position, degrees: five of them are a slip, and never less than 0.05°.
    pub fn new(index_sigma_deg: f64) -> Self {
        let least_deg = (5.0 * index_sigma_deg).max(0.05);
        Self { least_deg, sum: Direction::default(), seconds: 0, suspect: false }
    }

    /// Takes the mean angle of the next second in which the motor was not commanded. The angle that the index had before, if
    /// it slipped within this second: the second is at no angle and belongs to no dwell, and the next one begins another.
    pub fn push(&mut self, index: Direction) -> Option<Direction> {
        let before = self.sum;
        let jump_deg = if self.seconds == 0 { 0.0 } else { wrap_180_deg(index.deg() - before.deg()).abs() };
        if jump_deg > self.least_deg && self.seconds >= STILL_SECONDS {
            self.restart();
            return Some(before);
        }
        let moved = jump_deg > STILL * self.least_deg;
        if moved && !self.suspect && jump_deg <= self.least_deg {
            self.suspect = true;
            return None;
        }
        if moved {
            self.restart();
        }
        self.suspect = false;
        self.sum = Direction { cos: self.sum.cos + index.cos, sin: self.sum.sin + index.sin };
        self.seconds = self.seconds.saturating_add(1);
        None
    }

    /// It stands here since it came to rest: nothing is to be waited for.
    pub fn stand(&mut self, index: Direction) {
        *self = Self { sum: index, seconds: STILL_SECONDS, suspect: false, ..*self };
    }

    /// The motor is commanded.
    pub fn restart(&mut self) {
        *self = Self { sum: Direction::default(), seconds: 0, suspect: false, ..*self };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of the first second that is a slip, and the angle before it, degrees.
    fn slip(angles_deg: impl Iterator<Item = f64>) -> Option<(usize, f64)> {
        let mut watch = IndexWatch::new(0.02);
        angles_deg
            .map(Direction::of_deg)
            .enumerate()
            .find_map(|(second, index)| watch.push(index).map(|before| (second, before.deg())))
    }

    #[test]
    fn a_jump_is_found_in_its_second() {
        // Half a degree, two thirds of the way through the tenth second, with a dither of the encoder's last digit.
        let dither = |second: i32| f64::from(second % 3 - 1) * 0.01;
        let jumping = |second: i32| {
            90.0 + if second < 9 {
                0.0
            } else if second == 9 {
                0.17
            } else {
                0.5
            } + dither(second)
        };
        let (second, before_deg) = slip((0..20).map(jumping)).unwrap();
        assert_eq!(second, 9);
        assert!((before_deg - 90.0).abs() < 0.01);
        assert_eq!(slip((0..60).map(|second| 90.0 + dither(second))), None);
        // Late in a second, which then is off by less than a slip: found in the next one.
        let late = |second: i32| {
            if second < 9 {
                90.0
            } else if second == 9 {
                90.08
            } else {
                90.5
            }
        };
        assert_eq!(slip((0..20).map(late)).map(|(second, _)| second), Some(10));
        // Across the mark.
        assert!(slip((0..20).map(|second| if second < 10 { 359.9 } else { 0.2 })).is_some());
    }

    #[test]
    fn a_rotation_is_no_slip() {
        for speed_deg_s in [0.001, 0.005, 0.01, 0.02, 0.03, 0.05, 0.2, 30.0] {
            assert_eq!(slip((0..600).map(|second| speed_deg_s * f64::from(second))), None, "{speed_deg_s}");
        }
    }

    #[test]
    fn what_stands_at_a_known_angle_is_watched_at_once() {
        let mut watch = IndexWatch::new(0.02);
        watch.stand(Direction::of_deg(90.0));
        assert_eq!(watch.push(Direction::of_deg(90.03)), None);
        assert!(watch.push(Direction::of_deg(90.3)).is_some());
    }

    #[test]
    fn after_a_move_it_watches_again() {
        // Two seconds of turning, ten at rest, and a slip.
        let angles_deg = [0.0, 30.0, 75.0].into_iter().chain([90.0; 10]).chain([90.3; 5]);
        assert_eq!(slip(angles_deg), Some((13, 90.0)));
    }
}

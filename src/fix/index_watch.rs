//! Watches the index angle through a dwell: the motor stands, so the reading must stand too.
//!
//! A reading that jumps is a spindle that moved, or an encoder that slipped on it. The second in which it happens is known at
//! once; which of the two it was, only the gyro can say, from both dwells: see [`super::solve`].

use crate::index::Direction;
use crate::units::wrap_180_deg;

/// Seconds that must have stood still before a jump is one. (A slow rotation is no slip.)
const STILL_SECONDS: u16 = 3;
/// How still, as a share of the least slip.
const STILL: f64 = 0.4;

/// The index angle of a dwell so far.
#[derive(Clone, Copy, Debug)]
pub struct IndexWatch {
    /// Least change of the second's mean angle that is a slip, degrees.
    least_deg: f64,
    sum: Direction,
    seconds: u16,
    widest_deg: f64,
}

impl IndexWatch {
    /// With the encoder's sigma at one position, degrees: five of them are a slip, and never less than 0.05°.
    pub fn new(index_sigma_deg: f64) -> Self {
        let least_deg = (5.0 * index_sigma_deg).max(0.05);
        Self { least_deg, sum: Direction { cos: 0.0, sin: 0.0 }, seconds: 0, widest_deg: 0.0 }
    }

    /// Takes the mean angle of the next second of a dwell. The angle that the index had before, if it slipped within this
    /// second: the second is at no angle and belongs to no dwell, and the next one begins another.
    pub fn push(&mut self, index: Direction) -> Option<Direction> {
        let before = self.sum;
        let jump_deg = if self.seconds == 0 { 0.0 } else { wrap_180_deg(index.deg() - before.deg()) };
        if self.seconds >= STILL_SECONDS && self.widest_deg <= STILL * self.least_deg && jump_deg.abs() > self.least_deg
        {
            self.restart();
            return Some(before);
        }
        self.widest_deg = self.widest_deg.max(jump_deg.abs());
        self.sum = Direction { cos: before.cos + index.cos, sin: before.sin + index.sin };
        self.seconds = self.seconds.saturating_add(1);
        None
    }

    /// Another dwell begins.
    pub fn restart(&mut self) {
        self.sum = Direction { cos: 0.0, sin: 0.0 };
        self.seconds = 0;
        self.widest_deg = 0.0;
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
        // Across the mark.
        assert!(slip((0..20).map(|second| if second < 10 { 359.9 } else { 0.2 })).is_some());
    }

    #[test]
    fn a_slow_rotation_is_no_slip() {
        assert_eq!(slip((0..60).map(|second| 0.2 * f64::from(second))), None);
    }
}

//! Watches the index angle while the motor stands: the reading must stand too.
//!
//! A reading that jumps is a spindle that moved, or an encoder that slipped on it. The second in which it happens is known at
//! once; which of the two it was, only the gyro can say, from the dwells before and after: see [`super::solve`].
//!
//! An error model may know better. Where the reading jumps and the angle that the model makes of it stands, the model explains the jump. Where the reading
//! stands and the angle by the model moves, the encoder's error changes and the drive, which closes on the reading, turns the axis. Neither is a slip: of a
//! slip both jump.

use crate::sensing::index::Direction;
use crate::units::wrap_180_deg;

/// Seconds that must agree before a jump is one. (A drive that turns never rests that long, and a slow rotation is
/// no slip.)
const STILL_SECONDS: u16 = 2;
/// How still, as a share of the least slip.
const STILL: f64 = 0.4;

/// The index angle of a second, or the sum of those of several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angle {
    /// As it was read.
    pub read: Direction,
    /// As the error model makes it; `None` where that is not known.
    pub by_model: Option<Direction>,
}

impl Angle {
    /// A reading, degrees, that by the error model is too large by so much.
    pub fn of_reading(read_deg: f64, error_deg: f64) -> Self {
        let by_model = Some(Direction::of_deg(read_deg - error_deg));
        Self { read: Direction::of_deg(read_deg), by_model }
    }

    /// By how much the reading is too large by the error model, degrees.
    pub fn error_deg(&self) -> f64 {
        self.by_model.map_or(0.0, |by_model| wrap_180_deg(self.read.deg() - by_model.deg()))
    }

    /// By the model, where that is known.
    fn best(&self) -> Direction {
        self.by_model.unwrap_or(self.read)
    }

    /// By how much another one is off, degrees: as it was read, or by the model if that is less.
    fn jump_deg(&self, next: &Self) -> f64 {
        let apart_deg = |next: Direction, own: Direction| wrap_180_deg(next.deg() - own.deg()).abs();
        let read_deg = apart_deg(next.read, self.read);
        let by_model = next.by_model.zip(self.by_model);
        by_model.map_or(read_deg, |(next, own)| read_deg.min(apart_deg(next, own)))
    }

    fn plus(&self, next: &Self) -> Self {
        let sum = |own: Direction, next: Direction| Direction { cos: own.cos + next.cos, sin: own.sin + next.sin };
        Self {
            read: sum(self.read, next.read),
            by_model: next.by_model.map(|next| self.by_model.map_or(next, |own| sum(own, next))),
        }
    }
}

/// The index angle since it came to rest.
#[derive(Clone, Copy, Debug)]
pub struct IndexWatch {
    /// Least change of the second's mean angle that is a slip, degrees.
    least_deg: f64,
    sum: Angle,
    seconds: u16,
    /// The last second was off by more than what is still and less than a slip: a slip may have begun late in it.
    suspect: bool,
}

impl IndexWatch {
    /// With the encoder's sigma at one position, degrees: five of them are a slip, and never less than 0.05°.
    pub fn new(index_sigma_deg: f64) -> Self {
        let least_deg = (5.0 * index_sigma_deg).max(0.05);
        Self { least_deg, sum: Angle::default(), seconds: 0, suspect: false }
    }

    /// Takes the mean angle of the next second in which the motor was not commanded. The angle that the index had before, if
    /// it slipped within this second: the second is at no angle and belongs to no dwell, and the next one begins another.
    pub fn push(&mut self, index: Angle) -> Option<Direction> {
        let before = self.sum;
        let jump_deg = if self.seconds == 0 { 0.0 } else { before.jump_deg(&index) };
        if jump_deg > self.least_deg && self.seconds >= STILL_SECONDS {
            self.restart();
            return Some(before.best());
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
        self.sum = self.sum.plus(&index);
        self.seconds = self.seconds.saturating_add(1);
        None
    }

    /// It stands here since it came to rest: nothing is to be waited for.
    pub fn stand(&mut self, index: Angle) {
        *self = Self { sum: index, seconds: STILL_SECONDS, suspect: false, ..*self };
    }

    /// The motor is commanded.
    pub fn restart(&mut self) {
        *self = Self { sum: Angle::default(), seconds: 0, suspect: false, ..*self };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An angle as it was read, degrees; the model, if it says anything, takes an error from it.
    fn read(read_deg: f64, error_deg: Option<f64>) -> Angle {
        let of_model = error_deg.map(|error_deg| Angle::of_reading(read_deg, error_deg));
        of_model.unwrap_or(Angle { read: Direction::of_deg(read_deg), by_model: None })
    }

    /// Number of the first second that is a slip, and the angle before it, degrees.
    fn first_slip(angles: impl Iterator<Item = Angle>) -> Option<(usize, f64)> {
        let mut watch = IndexWatch::new(0.02);
        angles.enumerate().find_map(|(second, index)| watch.push(index).map(|before| (second, before.deg())))
    }

    /// The same of readings.
    fn slip(angles_deg: impl Iterator<Item = f64>) -> Option<(usize, f64)> {
        first_slip(angles_deg.map(|angle_deg| read(angle_deg, None)))
    }

    /// The reading jumps by 2.3° in the tenth second, or stands. A model takes 2.3° from then on, or 1° from the fifteenth second on, or half a degree all the time: it
    /// explains the jump, or says that the axis turned, or that both jump alike. The slip is from 89.5° then.
    #[test]
    fn what_a_model_explains_is_no_slip() {
        let from = |first: i32, size_deg: f64| move |second: i32| if second < first { 0.0 } else { size_deg };
        let (jump, late, always) = (from(10, 2.3), from(15, 1.0), from(0, 0.5));
        let angles = |reads: &dyn Fn(i32) -> f64, error: &dyn Fn(i32) -> f64| {
            first_slip((0..30).map(|second| read(90.0 + reads(second), Some(error(second)))))
        };
        assert_eq!(angles(&jump, &jump), None);
        assert_eq!(angles(&|_| 0.0, &late), None);
        let (second, before_deg) = angles(&jump, &always).unwrap();
        assert!(second == 10 && (before_deg - 89.5).abs() < 1e-9, "{second} {before_deg}");
        // Another jump than the model's, and at another time.
        assert!(angles(&jump, &from(10, 1.0)).is_some() && angles(&jump, &late).is_some());
    }

    /// It stands at a reading of 90°, which is right while the index turns and 2.3° too large from then on, and the reading jumps by as much; or of which the model makes
    /// 89° all the time.
    #[test]
    fn where_it_stands_by_the_model() {
        let mut watch = IndexWatch::new(0.02);
        watch.stand(Angle::of_reading(90.0, 0.0));
        assert_eq!(watch.push(read(92.3, Some(2.3))), None);
        watch.stand(Angle::of_reading(90.0, 1.0));
        assert_eq!(watch.push(read(90.0, Some(1.0))), None);
        assert!(watch.push(read(90.3, Some(1.0))).is_some());
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
        watch.stand(read(90.0, None));
        assert_eq!(watch.push(read(90.03, None)), None);
        assert!(watch.push(read(90.3, None)).is_some());
    }

    #[test]
    fn after_a_move_it_watches_again() {
        // Two seconds of turning, ten at rest, and a slip.
        let angles_deg = [0.0, 30.0, 75.0].into_iter().chain([90.0; 10]).chain([90.3; 5]);
        assert_eq!(slip(angles_deg), Some((13, 90.0)));
    }
}

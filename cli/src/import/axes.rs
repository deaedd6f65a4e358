//! Where the axes of a foreign triad point, seen from the project's body frame: forward, left, up.

use serde::Deserialize;

/// A direction in the instrument's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

impl Direction {
    /// Its place in (forward, left, up), and its sign there.
    fn place(self) -> (usize, i8) {
        match self {
            Self::Forward => (0, 1),
            Self::Back => (0, -1),
            Self::Left => (1, 1),
            Self::Right => (1, -1),
            Self::Up => (2, 1),
            Self::Down => (2, -1),
        }
    }
}

/// Brings what was measured along two or three foreign axes into (forward, left, up).
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    directions: Vec<Direction>,
}

/// Why directions are no axes of a triad, or of a pair of level accelerometers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AxesError {
    #[error("two of them lie along one line")]
    Parallel,
    #[error(
        "they are left-handed (the first turned into the second must give the third, right-handed): one of them points \
         the other way, or two columns are exchanged. If the columns are listed in another order than the instrument's x, y, z, \
         list them in that order, in `columns` and in `axes` alike"
    )]
    LeftHanded,
    #[error("without a third axis they must be forward or back, and left or right")]
    NotLevel,
}

impl Axes {
    /// Axes for two or three columns, in the columns' order.
    pub fn new(directions: &[Direction]) -> Result<Self, AxesError> {
        let places: Vec<(usize, i8)> = directions.iter().map(|direction| direction.place()).collect();
        let along = |wanted: usize| places.iter().filter(|(place, _)| *place == wanted).count();
        if (0..3).any(|place| along(place) > 1) {
            return Err(AxesError::Parallel);
        }
        match places[..] {
            [(first, s1), (second, s2), (_, s3)] => {
                let cyclic = (first + 1) % 3 == second;
                let handedness = s1 * s2 * s3 * if cyclic { 1 } else { -1 };
                if handedness < 0 {
                    return Err(AxesError::LeftHanded);
                }
            }
            _ if along(0) == 1 && along(1) == 1 => {}
            _ => return Err(AxesError::NotLevel),
        }
        Ok(Self { directions: directions.to_owned() })
    }

    /// (forward, left, up) of values along the foreign axes; an axis that is not measured stays 0.
    pub fn body(&self, foreign: &[f64]) -> [f64; 3] {
        let mut body = [0.0; 3];
        for (direction, value) in self.directions.iter().zip(foreign) {
            let (place, sign) = direction.place();
            body[place] = f64::from(sign) * value;
        }
        body
    }

    /// Whether all three directions are measured.
    pub fn is_triad(&self) -> bool {
        self.directions.len() == 3
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Direction::{Back, Down, Forward, Left, Right, Up};

    #[test]
    fn common_frames_by_hand() {
        let body = |directions: &[Direction]| Axes::new(directions).unwrap().body(&[1.0, 2.0, 3.0]);
        assert_eq!(body(&[Forward, Left, Up]), [1.0, 2.0, 3.0]);
        assert_eq!(body(&[Right, Forward, Up]), [2.0, -1.0, 3.0]);
        // Forward, right, down: aircraft axes.
        assert_eq!(body(&[Forward, Right, Down]), [1.0, -2.0, -3.0]);
        assert_eq!(body(&[Up, Back, Right]), [-2.0, -3.0, 1.0]);
        assert_eq!(body(&[Left, Back]), [-2.0, 1.0, 0.0]);
    }

    #[test]
    fn exactly_the_24_rotations_are_right_handed() {
        let all = &[Forward, Back, Left, Right, Up, Down];
        let triples = (0..216).map(|i| [all[i / 36], all[i / 6 % 6], all[i % 6]]);
        let verdicts: Vec<_> = triples.map(|axes| Axes::new(&axes).err()).collect();
        let count = |verdict| verdicts.iter().filter(|found| **found == verdict).count();
        assert_eq!(count(None), 24);
        assert_eq!(count(Some(AxesError::LeftHanded)), 24);
        assert_eq!(count(Some(AxesError::Parallel)), 216 - 48);
        assert_eq!(Axes::new(&[Forward, Up]), Err(AxesError::NotLevel));
    }
}

//! Which way the axes of a triad point on the table.

use quantities::earth::EarthRate;

/// A direction in the local frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    East,
    West,
    North,
    South,
    Up,
    Down,
}

/// Directions of x, y and z; a right-handed triad at right angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes([Direction; 3]);

/// Why three letters are not the axes of a triad.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxesError {
    /// Not three letters of E, W, N, S, U, D.
    Letters,
    /// Two of the three lie along one line.
    NotPerpendicular,
    /// z does not point where x turned to y by a right-hand screw goes: such a triad cannot be turned into place.
    LeftHanded,
}

impl core::fmt::Display for AxesError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Letters => "three letters of E, W, N, S, U, D: which way x, y and z point",
            Self::NotPerpendicular => "three directions at right angles, such as ENU",
            Self::LeftHanded => "a right-handed triad, such as ENU; this one is its mirror image",
        })
    }
}

impl Direction {
    /// Of its capital letter.
    pub fn of_letter(letter: char) -> Option<Self> {
        Some(match letter {
            'E' => Self::East,
            'W' => Self::West,
            'N' => Self::North,
            'S' => Self::South,
            'U' => Self::Up,
            'D' => Self::Down,
            _ => return None,
        })
    }

    /// Unit vector in east, north, up.
    fn east_north_up(self) -> [i8; 3] {
        match self {
            Self::East => [1, 0, 0],
            Self::West => [-1, 0, 0],
            Self::North => [0, 1, 0],
            Self::South => [0, -1, 0],
            Self::Up => [0, 0, 1],
            Self::Down => [0, 0, -1],
        }
    }

    /// What a perfect gyro reads whose axis points this way, °/h.
    fn rate_deg_h(self, earth: &EarthRate) -> f64 {
        let [_, north, up] = self.east_north_up().map(f64::from);
        north * earth.north_deg_h + up * earth.up_deg_h
    }
}

impl Axes {
    /// Of three capital letters, such as "ENU".
    pub fn parse(text: &str) -> Result<Self, AxesError> {
        let mut letters = text.chars().map(Direction::of_letter);
        let (Some(Some(x)), Some(Some(y)), Some(Some(z)), None) =
            (letters.next(), letters.next(), letters.next(), letters.next())
        else {
            return Err(AxesError::Letters);
        };
        let [[x1, x2, x3], [y1, y2, y3], z_axis] = [x, y, z].map(Direction::east_north_up);
        let cross = [x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1];
        if cross == z_axis {
            Ok(Self([x, y, z]))
        } else if cross.map(|part| -part) == z_axis {
            Err(AxesError::LeftHanded)
        } else {
            Err(AxesError::NotPerpendicular)
        }
    }

    /// Rates about x, y and z, °/h, right-handed, of a triad at rest on the Earth.
    pub fn input_deg_h(&self, earth: &EarthRate) -> [f64; 3] {
        self.0.map(|direction| direction.rate_deg_h(earth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quantities::earth::earth_rate;

    #[test]
    fn inputs_of_the_six_positions() {
        let earth = earth_rate(34.75).unwrap();
        let (c, s) = (earth.north_deg_h, earth.up_deg_h);
        for (axes, input) in [
            ("ENU", [0.0, c, s]),
            ("WSU", [0.0, -c, s]),
            ("WND", [0.0, c, -s]),
            ("NED", [c, 0.0, -s]),
            ("SWD", [-c, 0.0, -s]),
            ("NWU", [c, 0.0, s]),
        ] {
            assert_eq!(Axes::parse(axes).unwrap().input_deg_h(&earth), input, "{axes}");
        }
    }

    #[test]
    fn the_southern_earth_turns_the_other_way_about_up() {
        // At −30°: up component −15.041067/2.
        let earth = earth_rate(-30.0).unwrap();
        let [_, _, z] = Axes::parse("ENU").unwrap().input_deg_h(&earth);
        assert!((z + 7.5205335).abs() < 1e-9);
    }

    #[test]
    fn what_is_not_a_triad_is_refused() {
        assert_eq!(Axes::parse("NEU"), Err(AxesError::LeftHanded));
        assert_eq!(Axes::parse("EWU"), Err(AxesError::NotPerpendicular));
        assert_eq!(Axes::parse("EEN"), Err(AxesError::NotPerpendicular));
        for text in ["", "EN", "ENUU", "enu", "ENX"] {
            assert_eq!(Axes::parse(text), Err(AxesError::Letters), "{text:?}");
        }
    }
}

//! Direction cosines, and heading, pitch and roll.

use nalgebra::{Matrix3, Vector3};
use quantities::units::{DEG_PER_RAD, sin_cos_deg, wrap_360_deg};

/// Heading, pitch and roll of the block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angles {
    /// Of the mark (x axis), clockwise from true north, degrees, [0°, 360°).
    pub heading_deg: f64,
    /// Nose up positive, degrees, −90° … 90°.
    pub pitch_deg: f64,
    /// Left side up positive, degrees, (−180°, 180°].
    pub roll_deg: f64,
}

impl Angles {
    /// Direction cosines: the matrix that takes block axes (x forward, y left, z up) to east, north, up.
    ///
    /// Turned by 90° − heading about up, then by −pitch about the left axis, then by roll about the forward axis.
    pub fn direction_cosines(&self) -> Matrix3<f64> {
        let (sin_h, cos_h) = sin_cos_deg(self.heading_deg);
        let (sin_p, cos_p) = sin_cos_deg(self.pitch_deg);
        let (sin_r, cos_r) = sin_cos_deg(self.roll_deg);
        let level_forward = Vector3::new(sin_h, cos_h, 0.0);
        let level_left = Vector3::new(-cos_h, sin_h, 0.0);
        let up = Vector3::new(0.0, 0.0, 1.0);
        // Along the roll axis, and normal to it in the vertical plane.
        let forward = level_forward * cos_p + up * sin_p;
        let above = up * cos_p - level_forward * sin_p;
        Matrix3::from_columns(&[forward, level_left * cos_r + above * sin_r, above * cos_r - level_left * sin_r])
    }

    /// Heading, pitch and roll of direction cosines (block axes to east, north, up). With the nose straight up or down
    /// heading and roll are one rotation, and which of them has it is accidental.
    pub fn of(direction_cosines: &Matrix3<f64>) -> Self {
        let c = direction_cosines;
        let horizontal = libm::hypot(c.m11, c.m21);
        Self {
            heading_deg: wrap_360_deg(libm::atan2(c.m11, c.m21) * DEG_PER_RAD),
            pitch_deg: libm::atan2(c.m31, horizontal) * DEG_PER_RAD,
            roll_deg: libm::atan2(c.m32, c.m33) * DEG_PER_RAD,
        }
    }
}

/// The skew-symmetric matrix of `v`: times a vector it is the cross product v × that vector.
pub fn cross_matrix(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// The orthogonal matrix nearest to one that is almost orthogonal: one step of C (3 − CᵀC) / 2, whose error is of the
/// second order in that of C (Bar-Itzhack, 1975).
pub fn orthogonalised(c: &Matrix3<f64>) -> Matrix3<f64> {
    c * (Matrix3::identity() * 3.0 - c.transpose() * c) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(heading_deg: f64, pitch_deg: f64, roll_deg: f64) -> Matrix3<f64> {
        Angles { heading_deg, pitch_deg, roll_deg }.direction_cosines()
    }

    fn near(a: Vector3<f64>, b: [f64; 3]) {
        assert!((a - Vector3::from(b)).norm() < 1e-7, "{a:?} {b:?}");
    }

    #[test]
    fn heading_pitch_and_roll_have_their_signs() {
        // East: forward is (1, 0, 0), left points north.
        let east = matrix(90.0, 0.0, 0.0);
        near(east.column(0).into(), [1.0, 0.0, 0.0]);
        near(east.column(1).into(), [0.0, 1.0, 0.0]);
        // North, nose up by 30°: cos 30° = 0.8660254, sin 30° = 0.5; the z axis leans back to the south.
        let nose_up = matrix(0.0, 30.0, 0.0);
        near(nose_up.column(0).into(), [0.0, 0.8660254, 0.5]);
        near(nose_up.column(2).into(), [0.0, -0.5, 0.8660254]);
        // North, left (west) side up by 30°: the left axis rises, the z axis leans to the east.
        let left_up = matrix(0.0, 0.0, 30.0);
        near(left_up.column(1).into(), [-0.8660254, 0.0, 0.5]);
        near(left_up.column(2).into(), [0.5, 0.0, 0.8660254]);
    }

    #[test]
    fn a_still_block_feels_what_the_level_accelerometers_feel() {
        // Pitch 30°, roll 20°: ax = 0.5, ay = sin 20° · cos 30° = 0.2961981, az = cos 20° · cos 30° = 0.8137977.
        let force = matrix(123.0, 30.0, 20.0).transpose() * Vector3::z();
        near(force, [0.5, 0.2961981, 0.8137977]);
    }

    #[test]
    fn angles_come_back() {
        for angles in [[12.5, 0.0, 0.0], [359.0, -40.0, 170.0], [200.0, 89.0, -90.0]] {
            let [heading_deg, pitch_deg, roll_deg] = angles;
            let back = Angles::of(&matrix(heading_deg, pitch_deg, roll_deg));
            for (a, b) in [back.heading_deg, back.pitch_deg, back.roll_deg].into_iter().zip(angles) {
                assert!((a - b).abs() < 1e-9, "{back:?}");
            }
        }
    }

    #[test]
    fn a_matrix_that_is_almost_orthogonal_becomes_so() {
        let c = matrix(40.0, 10.0, -20.0);
        let spoilt = c + Matrix3::new(1e-5, 0.0, 2e-5, 0.0, -1e-5, 0.0, 0.0, 3e-5, 0.0);
        let mended = orthogonalised(&spoilt);
        assert!((mended.transpose() * mended - Matrix3::identity()).norm() < 1e-8);
        assert!((mended - c).norm() < 4e-5);
    }

    #[test]
    fn the_cross_matrix_is_right_handed() {
        near(cross_matrix(&Vector3::x()) * Vector3::y(), [0.0, 0.0, 1.0]);
        near(cross_matrix(&Vector3::new(1.0, 2.0, 3.0)) * Vector3::new(4.0, 5.0, 6.0), [-3.0, 6.0, -3.0]);
    }
}

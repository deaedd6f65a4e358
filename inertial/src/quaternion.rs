//! Unit quaternions: the orientation that increments are summed up in.

use nalgebra::{Matrix3, Vector3};

use super::rotation::Angles;

/// Below this squared angle, rad², sine and cosine of the half angle are taken from their series.
const SMALL_ANGLE_SQUARED: f64 = 0.04;

/// A rotation as the unit quaternion (w, v) = (cos φ/2, sin φ/2 · axis); as an orientation it takes block axes to
/// geographic ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    pub w: f64,
    pub v: Vector3<f64>,
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self { w: 1.0, v: Vector3::new(0.0, 0.0, 0.0) };

    /// Of a rotation vector, rad: right-handed about its direction by its length.
    pub fn from_rotation_vector(rotation_rad: &Vector3<f64>) -> Self {
        let squared = rotation_rad.norm_squared();
        let (w, per_rad) = if squared < SMALL_ANGLE_SQUARED {
            // cos h and sin h / 2h with h² = φ²/4; the first terms left out are below 1e-18.
            let h2 = 0.25 * squared;
            let cos = 1.0 - h2 / 2.0 * (1.0 - h2 / 12.0 * (1.0 - h2 / 30.0 * (1.0 - h2 / 56.0 * (1.0 - h2 / 90.0))));
            let sinc = 1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0 * (1.0 - h2 / 72.0 * (1.0 - h2 / 110.0))));
            (cos, 0.5 * sinc)
        } else {
            let angle_rad = libm::sqrt(squared);
            (libm::cos(0.5 * angle_rad), libm::sin(0.5 * angle_rad) / angle_rad)
        };
        Self { w, v: rotation_rad * per_rad }
    }

    /// The rotation vector, rad, its length within [0, π].
    pub fn rotation_vector(&self) -> Vector3<f64> {
        let sine = self.v.norm();
        // q and −q are the same rotation: the shorter way.
        let half_rad = if self.w < 0.0 { -libm::atan2(sine, -self.w) } else { libm::atan2(sine, self.w) };
        if sine > 1e-12 { self.v * (2.0 * half_rad / sine) } else { self.v * 2.0 * libm::copysign(1.0, self.w) }
    }

    /// Of direction cosines (Shepperd, 1978: the largest of the four squares is divided by).
    pub fn from_direction_cosines(c: &Matrix3<f64>) -> Self {
        let trace = c.m11 + c.m22 + c.m33;
        let largest = trace.max(c.m11).max(c.m22).max(c.m33);
        let (w, x, y, z) = if largest == trace {
            (1.0 + trace, c.m32 - c.m23, c.m13 - c.m31, c.m21 - c.m12)
        } else if largest == c.m11 {
            (c.m32 - c.m23, 1.0 + 2.0 * c.m11 - trace, c.m12 + c.m21, c.m13 + c.m31)
        } else if largest == c.m22 {
            (c.m13 - c.m31, c.m12 + c.m21, 1.0 + 2.0 * c.m22 - trace, c.m23 + c.m32)
        } else {
            (c.m21 - c.m12, c.m13 + c.m31, c.m23 + c.m32, 1.0 + 2.0 * c.m33 - trace)
        };
        Self { w, v: Vector3::new(x, y, z) }.normalised()
    }

    /// Direction cosines: the matrix that does to a vector what [`Self::rotate`] does.
    pub fn direction_cosines(&self) -> Matrix3<f64> {
        let Self { w, v } = self;
        let (x, y, z) = (v.x, v.y, v.z);
        Matrix3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        )
    }

    /// Of heading, pitch and roll.
    pub fn from_angles(angles: &Angles) -> Self {
        Self::from_direction_cosines(&angles.direction_cosines())
    }

    /// Heading, pitch and roll.
    pub fn angles(&self) -> Angles {
        Angles::of(&self.direction_cosines())
    }

    /// This rotation after `first`: the Hamilton product.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            w: self.w * first.w - self.v.dot(&first.v),
            v: first.v * self.w + self.v * first.w + self.v.cross(&first.v),
        }
    }

    /// The rotation back.
    pub fn inverse(&self) -> Self {
        Self { w: self.w, v: -self.v }
    }

    /// The vector in the other axes.
    pub fn rotate(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        let twice = self.v.cross(vector) * 2.0;
        vector + twice * self.w + self.v.cross(&twice)
    }

    /// Brought back to unit length; rounding makes it drift by some 1e-16 an update.
    pub fn normalised(&self) -> Self {
        let length = libm::sqrt(self.w * self.w + self.v.norm_squared());
        Self { w: self.w / length, v: self.v / length }
    }

    /// The orientation an interval later. `body_rad`: rotation of the block against the stars, in block axes;
    /// `geographic_rad`: rotation of the geographic axes against the stars (the Earth's, and that of moving over it), in
    /// geographic axes. Both are rotation vectors over the interval.
    pub fn advance(&self, body_rad: &Vector3<f64>, geographic_rad: &Vector3<f64>) -> Self {
        let body = Self::from_rotation_vector(body_rad);
        let geographic = Self::from_rotation_vector(geographic_rad);
        geographic.inverse().after(self).after(&body).normalised()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quantities::earth::earth_rate;
    use quantities::units::RAD_PER_DEG;

    fn near(a: &Vector3<f64>, b: &Vector3<f64>, by: f64) {
        assert!((a - b).norm() < by, "{a:?} {b:?}");
    }

    #[test]
    fn rotation_is_right_handed() {
        // A quarter turn about z takes x to y.
        let quarter = Quaternion::from_rotation_vector(&Vector3::new(0.0, 0.0, 90.0 * RAD_PER_DEG));
        near(&quarter.rotate(&Vector3::x()), &Vector3::y(), 1e-15);
        near(&(quarter.direction_cosines() * Vector3::x()), &Vector3::y(), 1e-15);
    }

    #[test]
    fn small_and_large_angles_meet() {
        for angle_rad in [1e-9, 0.1999, 0.2001, 1.0, 3.0] {
            let rotation = Vector3::new(0.6, 0.0, -0.8) * angle_rad;
            let quaternion = Quaternion::from_rotation_vector(&rotation);
            assert!((quaternion.w - libm::cos(0.5 * angle_rad)).abs() < 2e-16);
            assert!((quaternion.v.norm() - libm::sin(0.5 * angle_rad)).abs() < 2e-16);
            near(&quaternion.rotation_vector(), &rotation, 1e-15 * (1.0 + angle_rad));
        }
    }

    #[test]
    fn direction_cosines_come_back_from_every_quadrant() {
        for angles in [[0.0, 0.0, 0.0], [90.0, 10.0, 170.0], [270.0, -80.0, 100.0], [181.0, 5.0, -179.0]] {
            let [heading_deg, pitch_deg, roll_deg] = angles;
            let c = Angles { heading_deg, pitch_deg, roll_deg }.direction_cosines();
            let back = Quaternion::from_direction_cosines(&c).direction_cosines();
            assert!((back - c).norm() < 1e-14, "{angles:?}");
        }
    }

    #[test]
    fn heading_grows_clockwise_and_pitch_with_the_nose() {
        let level = Quaternion::from_angles(&Angles::default());
        // Rotation about up (block z) by +1° is counter-clockwise: the heading falls.
        let degree = |x: f64, y: f64, z: f64| Vector3::new(x, y, z) * RAD_PER_DEG;
        let after = |body| level.advance(&body, &Vector3::zeros()).angles();
        assert!((after(degree(0.0, 0.0, 1.0)).heading_deg - 359.0).abs() < 1e-12);
        // About left (y) the nose goes down; about forward (x) the left side goes up.
        assert!((after(degree(0.0, 1.0, 0.0)).pitch_deg + 1.0).abs() < 1e-12);
        assert!((after(degree(1.0, 0.0, 0.0)).roll_deg - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_block_that_stands_on_the_earth_keeps_its_angles() {
        let earth = earth_rate(34.75).unwrap();
        let angles = Angles { heading_deg: 77.0, pitch_deg: 3.0, roll_deg: -2.0 };
        let geographic = Vector3::new(0.0, earth.north_deg_h, earth.up_deg_h) * (RAD_PER_DEG / 3600.0);
        let body = angles.direction_cosines().transpose() * geographic;
        let mut orientation = Quaternion::from_angles(&angles);
        for _ in 0..3600 {
            orientation = orientation.advance(&body, &geographic);
        }
        let after = orientation.angles();
        assert!((after.heading_deg - 77.0).abs() < 1e-11 && (after.pitch_deg - 3.0).abs() < 1e-11, "{after:?}");
        // Without the Earth the inertial orientation stays: in an hour the heading would run by Ω sin φ ≈ 8.57° or so.
        let mut inertial = Quaternion::from_angles(&angles);
        for _ in 0..3600 {
            inertial = inertial.advance(&body, &Vector3::zeros());
        }
        assert!((inertial.angles().heading_deg - 77.0).abs() > 7.0);
    }
}

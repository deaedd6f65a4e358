//! Vectors and rotations of the plant. Everything the sensors feel follows from here.
//!
//! Local frame: east, north, up. Instrument frame: x forward along the mark, y left, z up. Case frame: the instrument frame
//! carried round the spindle by the index angle; the sensitive axis is fixed in it.

use nalgebra::{Unit, UnitQuaternion, Vector3};

/// Earth's rotation against the stars, rad/s (WGS 84: NIMA TR8350.2, third edition).
const EARTH_RATE_RAD_S: f64 = 7.292_115e-5;

/// Gravity, m/s².
pub const GRAVITY_M_S2: f64 = 9.80665;
/// Arcseconds in a radian.
pub const ARCSEC_PER_RAD: f64 = 3600.0 * 180.0 / std::f64::consts::PI;

/// Earth's rotation in east, north, up, rad/s, at a geodetic latitude.
pub fn earth_rate_rad_s(latitude_deg: f64) -> Vector3<f64> {
    // The rotation axis lies in the meridian plane, latitude above the northern horizon.
    let (up, north) = latitude_deg.to_radians().sin_cos();
    Vector3::new(0.0, north, up) * EARTH_RATE_RAD_S
}

/// How the base stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BaseAngles {
    /// Nose up, rad.
    pub pitch_rad: f64,
    /// Left side up, rad.
    pub roll_rad: f64,
    /// Azimuth of the mark, clockwise from north, rad.
    pub azimuth_rad: f64,
}

impl BaseAngles {
    /// The rotation that takes instrument coordinates to east, north, up.
    ///
    /// Turned to its azimuth, then nose up about −y, then left side up about x: the order in which a level
    /// accelerometer pair reads ax = sin p, ay = sin r · cos p.
    pub fn attitude(&self) -> UnitQuaternion<f64> {
        let heading =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2 - self.azimuth_rad);
        let pitch = UnitQuaternion::from_axis_angle(&-Vector3::y_axis(), self.pitch_rad);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.roll_rad);
        heading * pitch * roll
    }
}

/// How the gyro sits in the instrument.
#[derive(Debug, Clone)]
pub struct Mounting {
    spindle: UnitQuaternion<f64>,
    axis_in_case: Unit<Vector3<f64>>,
}

impl Mounting {
    /// `spindle_tilt_rad`: tilt of the spindle from z towards x and towards y; `axis_elevation_rad`: of the sensitive axis
    /// above the plane normal to the spindle.
    pub fn new(spindle_tilt_rad: [f64; 2], axis_elevation_rad: f64) -> Self {
        let [towards_x, towards_y] = spindle_tilt_rad;
        let (sine, cosine) = axis_elevation_rad.sin_cos();
        Self {
            spindle: UnitQuaternion::from_scaled_axis(Vector3::new(-towards_y, towards_x, 0.0)),
            axis_in_case: Unit::new_normalize(Vector3::new(cosine, 0.0, sine)),
        }
    }

    /// Attitude of the gyro's case in east, north, up.
    pub fn case(&self, attitude: &UnitQuaternion<f64>, index_rad: f64) -> UnitQuaternion<f64> {
        attitude * self.spindle * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), index_rad)
    }

    /// Direction of the sensitive axis in east, north, up.
    pub fn axis(&self, case: &UnitQuaternion<f64>) -> Vector3<f64> {
        case * self.axis_in_case.into_inner()
    }

    /// Angle about the sensitive axis by which the case turned between two attitudes relative to the Earth, rad,
    /// right-handed. Over a tick the direction of rotation is constant enough for the rotation vector to be the integral
    /// of the rate (the coning that is left is second order in angles of milliradians).
    pub fn turned_rad(&self, before: &UnitQuaternion<f64>, after: &UnitQuaternion<f64>) -> f64 {
        (before.inverse() * after).scaled_axis().dot(&self.axis_in_case)
    }
}

/// Specific force in instrument coordinates, g: a body at rest is pushed upwards by 1 g.
pub fn specific_force_g(attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
    attitude.inverse() * Vector3::z()
}

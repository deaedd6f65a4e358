//! Strapdown navigation in geographic axes: attitude, velocity and position from the increments of a block.
//!
//! P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition 2013, section 5.4;
//! Earth's figure and normal gravity by WGS 84 (NIMA TR8350.2).

use libm::{cos, sin, sqrt, tan};
use nalgebra::{Matrix3, Vector3};
use quantities::earth::{
    EARTH_RATE_DEG_H, ECCENTRICITY_2, EQUATOR_GRAVITY_M_S2, SEMI_MAJOR_M, SOMIGLIANA, normal_gravity_m_s2,
};
use quantities::units::RAD_PER_DEG;

use crate::rotation::orthogonalised;
use crate::{Algorithm, Increment, Integrator, Quaternion};

/// Earth's rate, rad/s.
const EARTH_RATE_RAD_S: f64 = EARTH_RATE_DEG_H * RAD_PER_DEG / 3600.0;

/// Where and how the block is.
#[derive(Clone, Debug)]
pub struct Navigation {
    /// Block axes to east, north, up.
    pub attitude: Matrix3<f64>,
    /// East, north, up, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// North positive.
    pub latitude_rad: f64,
    /// East positive.
    pub longitude_rad: f64,
    /// Above the ellipsoid.
    pub height_m: f64,
    integrator: Integrator,
}

/// The Earth where the block is.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Radii of curvature of the meridian and of the prime vertical, with the height, m.
    pub meridian_m: f64,
    pub prime_vertical_m: f64,
    /// Earth's rate in east, north, up, rad/s.
    pub earth_rad_s: Vector3<f64>,
    /// Downwards, m/s².
    pub gravity_m_s2: f64,
    /// Growth of gravity towards north, 1/s².
    pub gravity_growth_1_s2: f64,
    pub tan_latitude: f64,
}

impl Place {
    /// The place at a latitude and height above the ellipsoid.
    pub fn at(latitude_rad: f64, height_m: f64) -> Self {
        let (s, c) = (sin(latitude_rad), cos(latitude_rad));
        let flat = 1.0 - ECCENTRICITY_2 * s * s;
        let root = sqrt(flat);
        let meridian_m = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / (flat * root) + height_m;
        Self {
            meridian_m,
            prime_vertical_m: SEMI_MAJOR_M / root + height_m,
            earth_rad_s: EARTH_RATE_RAD_S * Vector3::new(0.0, c, s),
            gravity_m_s2: normal_gravity_m_s2(latitude_rad, height_m),
            // γ grows as γe·(k + e²/2)·sin²φ, to the first order in the flattening.
            gravity_growth_1_s2: EQUATOR_GRAVITY_M_S2 * (SOMIGLIANA + 0.5 * ECCENTRICITY_2) * 2.0 * s * c / meridian_m,
            tan_latitude: tan(latitude_rad),
        }
    }

    /// Rate of the geographic axes over the Earth, rad/s.
    pub fn transport_rad_s(&self, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
        let east = velocity_m_s.x / self.prime_vertical_m;
        Vector3::new(-velocity_m_s.y / self.meridian_m, east, east * self.tan_latitude)
    }
}

impl Navigation {
    /// Starts at a place; `attitude` takes block axes to east, north, up.
    pub fn new(
        attitude: Matrix3<f64>,
        velocity_m_s: Vector3<f64>,
        latitude_rad: f64,
        longitude_rad: f64,
        height_m: f64,
    ) -> Self {
        Self {
            attitude,
            velocity_m_s,
            latitude_rad,
            longitude_rad,
            height_m,
            integrator: Integrator::new(Algorithm::PreviousInterval),
        }
    }

    /// The Earth here.
    pub fn place(&self) -> Place {
        Place::at(self.latitude_rad, self.height_m)
    }

    /// One interval of `dt_s` on, by its increments without their known errors. Returns the specific force's integral in
    /// geographic axes, m/s.
    pub fn advance(&mut self, place: &Place, dt_s: f64, increment: Increment) -> Vector3<f64> {
        // One sample an interval: it always completes one.
        let Increment { angle_rad, velocity_m_s } = self.integrator.push(increment).unwrap_or(increment);
        let transport = place.transport_rad_s(&self.velocity_m_s);
        let frame = (place.earth_rad_s + transport) * dt_s;
        let in_last_axes = self.attitude * velocity_m_s;
        let force = in_last_axes - 0.5 * frame.cross(&in_last_axes);
        let coriolis = (2.0 * place.earth_rad_s + transport).cross(&self.velocity_m_s);
        let before = self.velocity_m_s;
        self.velocity_m_s += force - (coriolis + Vector3::new(0.0, 0.0, place.gravity_m_s2)) * dt_s;
        let mean = 0.5 * (before + self.velocity_m_s);
        self.move_by(place, &(mean * dt_s));
        self.attitude = rotation(&-frame) * self.attitude * rotation(&angle_rad);
        force
    }

    /// Moves the position east, north, up, m.
    pub fn move_by(&mut self, place: &Place, by_m: &Vector3<f64>) {
        self.latitude_rad += by_m.y / place.meridian_m;
        self.longitude_rad += by_m.x / (place.prime_vertical_m * cos(self.latitude_rad));
        self.height_m += by_m.z;
    }

    /// Turns the attitude by a small rotation in geographic axes, and keeps it a rotation.
    pub fn turn_by(&mut self, vector_rad: &Vector3<f64>) {
        self.attitude = orthogonalised(&(rotation(vector_rad) * self.attitude));
    }
}

fn rotation(vector_rad: &Vector3<f64>) -> Matrix3<f64> {
    Quaternion::from_rotation_vector(vector_rad).direction_cosines()
}

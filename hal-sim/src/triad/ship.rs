//! A ship under way with an inertial block that is indexed about the vertical, on a spherical Earth.

use crate::geometry::{ARCSEC_PER_RAD, earth_rate_rad_s};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Radius of the Earth (mean radius R1 of GRS 80), m.
const RADIUS_M: f64 = 6_371_008.8;
/// Gravity at the surface, directed to the centre, m/s².
const GRAVITY_M_S2: f64 = 9.80665;
/// A nautical mile, m; a knot is one in an hour.
const NAUTICAL_MILE_M: f64 = 1852.0;

/// Index angles of the four positions in the order of a cycle, degrees counter-clockwise. From each to the next: +180,
/// +90, −180, −90; every turn is undone within the cycle, and so is what a scale factor error makes of it.
const CYCLE_DEG: [f64; 4] = [0.0, 180.0, 270.0, 90.0];
/// Time at each, s, the turn to it included.
const STAY_S: f64 = 600.0;
/// Rate of turning, °/s.
const TURN_DEG_S: f64 = 6.0;

/// Where the ship goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShipVoyage {
    /// Latitude and longitude at the start, degrees.
    pub start_deg: [f64; 2],
    /// Course at the start, degrees clockwise from north; the ship follows the great circle.
    pub course_deg: f64,
    /// Speed over ground, knots.
    pub knots: f64,
}

/// What happened in a step, and where it led.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShipStep {
    /// End of the step, s.
    pub t_s: f64,
    /// Angles by which the block turned against the stars about its x, y, z, arcsec.
    pub turned_arcsec: [f64; 3],
    /// Change of velocity by specific force along x, y, z, m/s.
    pub velocity_m_s: [f64; 3],
    /// Position at the end, Earth-fixed: towards (0° N, 0° E), (0° N, 90° E), the north pole, m.
    pub position_m: [f64; 3],
}

impl ShipVoyage {
    /// Earth-fixed position, m, velocity, m/s, and attitude (block coordinates to Earth-fixed ones) at the start.
    pub fn start(&self) -> ([f64; 3], [f64; 3], [[f64; 3]; 3]) {
        let at = self.at(0.0);
        let attitude = at.attitude.matrix();
        let row = |i| [attitude[(i, 0)], attitude[(i, 1)], attitude[(i, 2)]];
        (at.position_m.into(), at.velocity_m_s.into(), [row(0), row(1), row(2)])
    }

    /// The steps of a voyage: each `dt_s` long, `hours` in all.
    pub fn steps(self, dt_s: f64, hours: f64) -> impl Iterator<Item = ShipStep> {
        let count = (hours * 3600.0 / dt_s).round() as u64;
        let earth_rad_s = earth_axis_rad_s();
        let mut before = self.at(0.0);
        (1..=count).map(move |step| {
            let t_s = step as f64 * dt_s;
            let after = self.at(t_s);
            let middle = self.at(t_s - 0.5 * dt_s);
            // The rotation against the stars between the two attitudes: what there is Earth-fixed, and the Earth's.
            let earth = Rotation3::from_scaled_axis(earth_rad_s * dt_s);
            let turned = (before.attitude.inverse() * earth * after.attitude).scaled_axis();
            let force = middle.attitude.inverse() * self.specific_force_m_s2(&middle);
            before = after;
            ShipStep {
                t_s,
                turned_arcsec: (turned * ARCSEC_PER_RAD).into(),
                velocity_m_s: (force * dt_s).into(),
                position_m: before.position_m.into(),
            }
        })
    }

    fn at(&self, t_s: f64) -> Moment {
        let [latitude, longitude] = self.start_deg.map(f64::to_radians);
        let up = Vector3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin());
        let east = Vector3::new(-longitude.sin(), longitude.cos(), 0.0);
        let north = up.cross(&east);
        let (sine, cosine) = self.course_deg.to_radians().sin_cos();
        let ahead = east * sine + north * cosine;
        let speed_m_s = self.knots * NAUTICAL_MILE_M / 3600.0;
        let (sine, cosine) = (speed_m_s / RADIUS_M * t_s).sin_cos();
        let (up, ahead) = (up * cosine + ahead * sine, ahead * cosine - up * sine);
        let deck = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[ahead, up.cross(&ahead), up]));
        let index = Rotation3::from_axis_angle(&Vector3::z_axis(), index_deg(t_s).to_radians());
        Moment {
            position_m: up * RADIUS_M,
            velocity_m_s: ahead * speed_m_s,
            attitude: UnitQuaternion::from_rotation_matrix(&(deck * index)).to_rotation_matrix(),
        }
    }

    /// In Earth-fixed axes: acceleration along the great circle, Coriolis, and the support against gravity.
    fn specific_force_m_s2(&self, at: &Moment) -> Vector3<f64> {
        let up = at.position_m.normalize();
        let towards_centre = at.velocity_m_s.norm_squared() / RADIUS_M;
        2.0 * earth_axis_rad_s().cross(&at.velocity_m_s) + up * (GRAVITY_M_S2 - towards_centre)
    }
}

struct Moment {
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    /// Block coordinates to Earth-fixed ones.
    attitude: Rotation3<f64>,
}

/// At the pole the Earth turns about the vertical.
fn earth_axis_rad_s() -> Vector3<f64> {
    Vector3::z() * earth_rate_rad_s(90.0).z
}

/// Index angle of the block at a time, degrees.
fn index_deg(t_s: f64) -> f64 {
    let stay = (t_s / STAY_S).floor();
    let into_s = t_s - stay * STAY_S;
    let number = stay as u64;
    let place = |number: u64| CYCLE_DEG[(number % 4) as usize];
    let to_deg = place(number);
    let Some(before) = number.checked_sub(1) else { return to_deg };
    let way_deg = to_deg - place(before);
    let left_deg = (way_deg.abs() - TURN_DEG_S * into_s).max(0.0);
    to_deg - left_deg * way_deg.signum()
}

/// Distance over the ground between two Earth-fixed positions, nautical miles.
pub fn distance_nmi(a_m: [f64; 3], b_m: [f64; 3]) -> f64 {
    let angle = Vector3::from(a_m).angle(&Vector3::from(b_m));
    angle * RADIUS_M / NAUTICAL_MILE_M
}

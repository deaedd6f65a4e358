//! A gyro triad on a three-axis table at rest on the Earth.

use super::gyros::{GyroTriad, REFERENCE_C, TriadErrors};
use crate::geometry::{ARCSEC_PER_RAD, earth_rate_rad_s};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// A position of the table by its three angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionOfTable {
    /// Angles of the inner, the middle and the outer gimbal, degrees.
    pub angles_deg: [f64; 3],
    /// Which way x, y, z then point, as the source says.
    pub axes: &'static str,
}

/// The six positions of the source.
pub const SIX_POSITIONS: [PositionOfTable; 6] = [
    PositionOfTable { angles_deg: [0.0, 0.0, 0.0], axes: "ENU" },
    PositionOfTable { angles_deg: [180.0, 180.0, 0.0], axes: "WSU" },
    PositionOfTable { angles_deg: [180.0, 0.0, 0.0], axes: "WND" },
    PositionOfTable { angles_deg: [180.0, 0.0, 270.0], axes: "NED" },
    PositionOfTable { angles_deg: [180.0, 0.0, 90.0], axes: "SWD" },
    PositionOfTable { angles_deg: [0.0, 0.0, 90.0], axes: "NWU" },
];

/// A blow: the triad swings on its adapter, and may stay turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knock {
    /// When, seconds from the beginning of the visit.
    pub at_s: f64,
    /// Amplitude of the swing about x, y, z of the case, arcsec; it dies away within a few seconds.
    pub swing_arcsec: f64,
    /// By how much the triad is turned about x, y, z of the case afterwards, arcsec.
    pub turned_arcsec: [f64; 3],
}

/// A sudden change of temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Warming {
    /// When, seconds from the beginning of the visit.
    pub at_s: f64,
    pub by_k: f64,
}

/// A visit to a position, recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    pub angles_deg: [f64; 3],
    /// Length of the recording, s.
    pub seconds: f64,
    /// Length of a row, s.
    pub interval_s: f64,
    /// The table comes from these angles during the first seconds and leaves for them in the last ones.
    pub moves_from_deg: Option<[f64; 3]>,
    /// Time that such a move takes, s.
    pub move_s: f64,
    pub knocks: Vec<Knock>,
    /// Temperature of the gyros at the beginning, °C.
    pub temp_c: f64,
    pub warming: Option<Warming>,
}

impl Visit {
    /// At rest throughout, rows of one second, 25 °C.
    pub fn at_rest(angles_deg: [f64; 3], seconds: f64) -> Self {
        Self {
            angles_deg,
            seconds,
            interval_s: 1.0,
            moves_from_deg: None,
            move_s: 0.0,
            knocks: Vec::new(),
            temp_c: REFERENCE_C,
            warming: None,
        }
    }

    fn temp_c_at(&self, t_s: f64) -> f64 {
        self.temp_c + self.warming.filter(|warming| t_s > warming.at_s).map_or(0.0, |warming| warming.by_k)
    }
}

/// A row of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableRow {
    /// End of the interval, seconds from the beginning of the visit.
    pub t_s: f64,
    /// Angle increments of x, y, z, arcsec.
    pub arcsec: [f64; 3],
    pub temp_c: f64,
}

/// The table with the triad on it.
#[derive(Debug, Clone)]
pub struct Table {
    triad: GyroTriad,
    earth_rad_s: Vector3<f64>,
    /// Errors of the three angles in the position that is visited, arcsec.
    error_arcsec: [f64; 3],
}

impl Table {
    /// At a latitude (degrees), with its triad just switched on.
    pub fn new(latitude_deg: f64, errors: &TriadErrors, seed: u64) -> Self {
        Self {
            triad: GyroTriad::new(errors, seed),
            earth_rad_s: earth_rate_rad_s(latitude_deg),
            error_arcsec: [0.0; 3],
        }
    }

    /// The triad, to ask what it really is.
    pub fn triad(&self) -> &GyroTriad {
        &self.triad
    }

    /// Sets the errors of the angles (inner, middle, outer) for the next visits, arcsec.
    pub fn set_error(&mut self, error_arcsec: [f64; 3]) {
        self.error_arcsec = error_arcsec;
    }

    /// Attitude of the case: takes case coordinates to east, north, up. At zero x points east, y north, z up; the outer
    /// gimbal turns about the vertical, the middle one carries its axis along x, the inner one along y.
    pub fn attitude(&self, angles_deg: [f64; 3]) -> UnitQuaternion<f64> {
        let turn = |axis, angle_deg: f64, error_arcsec: f64| {
            UnitQuaternion::from_axis_angle(&axis, angle_deg.to_radians() + error_arcsec / ARCSEC_PER_RAD)
        };
        let [inner, middle, outer] = angles_deg;
        let [inner_error, middle_error, outer_error] = self.error_arcsec;
        turn(Vector3::z_axis(), outer, outer_error)
            * turn(Vector3::x_axis(), middle, middle_error)
            * turn(Vector3::y_axis(), inner, inner_error)
    }

    /// Records a visit.
    pub fn visit(&mut self, visit: &Visit) -> Vec<TableRow> {
        let rows = (visit.seconds / visit.interval_s).round() as u32;
        let mut before = self.attitude_at(visit, 0.0);
        (1..=rows)
            .map(|row| {
                let t_s = f64::from(row) * visit.interval_s;
                let after = self.attitude_at(visit, t_s);
                let turned = (before.inverse() * after).scaled_axis();
                let middle = before.slerp(&after, 0.5);
                let with_earth = turned + middle.inverse() * self.earth_rad_s * visit.interval_s;
                before = after;
                let temp_c = visit.temp_c_at(t_s);
                self.triad.set_temperature(temp_c);
                let arcsec = self.triad.measure((with_earth * ARCSEC_PER_RAD).into(), visit.interval_s);
                TableRow { t_s, arcsec, temp_c }
            })
            .collect()
    }

    fn attitude_at(&self, visit: &Visit, t_s: f64) -> UnitQuaternion<f64> {
        let angles_deg = match visit.moves_from_deg {
            None => visit.angles_deg,
            Some(from_deg) => {
                let from_ends = t_s.min(visit.seconds - t_s);
                let there = (from_ends / visit.move_s).clamp(0.0, 1.0);
                let weight = 0.5 * (1.0 - (0.5 * TAU * there).cos());
                let mut angles_deg = from_deg;
                for (angle, to) in angles_deg.iter_mut().zip(visit.angles_deg) {
                    *angle += weight * (to - *angle);
                }
                angles_deg
            }
        };
        let away_arcsec: Vector3<f64> = visit.knocks.iter().map(|knock| away(knock, t_s)).sum();
        self.attitude(angles_deg) * UnitQuaternion::from_scaled_axis(away_arcsec / ARCSEC_PER_RAD)
    }
}

/// Rotation vector of a knock, arcsec: 3.3 Hz, dying away with a time constant of 1.2 s, towards what stays.
fn away(knock: &Knock, t_s: f64) -> Vector3<f64> {
    let since_s = t_s - knock.at_s;
    if since_s <= 0.0 {
        return Vector3::zeros();
    }
    let left = (-since_s / 1.2).exp();
    let swing_arcsec = knock.swing_arcsec * left * (TAU * 3.3 * since_s).sin();
    Vector3::repeat(swing_arcsec) + Vector3::from(knock.turned_arcsec) * (1.0 - left)
}

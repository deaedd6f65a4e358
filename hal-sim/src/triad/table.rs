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

/// Rows of a turn of the outer gimbal: 5° each, in which the Earth rate is taken along the middle attitude.
const ROWS_OF_A_TURN: u32 = 72;

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
pub struct Shock {
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
    pub shocks: Vec<Shock>,
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
            shocks: Vec::new(),
            temp_c: REFERENCE_C,
            warming: None,
        }
    }

    fn temp_c_at(&self, t_s: f64) -> f64 {
        self.temp_c + self.warming.filter(|warming| t_s > warming.at_s).map_or(0.0, |warming| warming.by_k)
    }
}

/// A turn of the outer gimbal at one rate: a step of a rate test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spin {
    /// Angles of the inner, the middle and the outer gimbal at its beginning, degrees.
    pub angles_deg: [f64; 3],
    /// Commanded rate of the outer gimbal, counter-clockwise seen from above, °/s; not 0.
    pub rate_deg_s: f64,
    /// By how much of itself the rate is off.
    pub rate_error: f64,
    /// Whole turns.
    pub turns: u32,
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

    /// Turns the outer gimbal and gives the mean outputs of x, y, z meanwhile, °/h.
    pub fn spin(&mut self, spin: &Spin) -> [f64; 3] {
        let rows = spin.turns * ROWS_OF_A_TURN;
        let interval_s = 360.0 / f64::from(ROWS_OF_A_TURN) / spin.rate_deg_s.abs();
        let [inner, middle, outer] = spin.angles_deg;
        let attitude = |table: &Self, row: f64| {
            let turned_deg = spin.rate_deg_s * (1.0 + spin.rate_error) * row * interval_s;
            table.attitude([inner, middle, outer + turned_deg])
        };
        let mut sums_arcsec = [0.0; 3];
        for row in 0..rows {
            let [before, half, after] = [0.0, 0.5, 1.0].map(|part| attitude(self, f64::from(row) + part));
            let turned = (before.inverse() * after).scaled_axis();
            let with_earth = turned + half.inverse() * self.earth_rad_s * interval_s;
            let arcsec = self.triad.measure((with_earth * ARCSEC_PER_RAD).into(), interval_s);
            sums_arcsec.iter_mut().zip(arcsec).for_each(|(sum, part)| *sum += part);
        }
        // Arcsec in a second are °/h.
        sums_arcsec.map(|sum| sum / (f64::from(rows) * interval_s))
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
        let away_arcsec: Vector3<f64> = visit.shocks.iter().map(|shock| away(shock, t_s)).sum();
        self.attitude(angles_deg) * UnitQuaternion::from_scaled_axis(away_arcsec / ARCSEC_PER_RAD)
    }
}

/// Rotation vector of a shock, arcsec: 3.3 Hz, dying away with a time constant of 1.2 s, towards what stays.
fn away(shock: &Shock, t_s: f64) -> Vector3<f64> {
    let since_s = t_s - shock.at_s;
    if since_s <= 0.0 {
        return Vector3::zeros();
    }
    let left = (-since_s / 1.2).exp();
    let swing_arcsec = shock.swing_arcsec * left * (TAU * 3.3 * since_s).sin();
    Vector3::repeat(swing_arcsec) + Vector3::from(shock.turned_arcsec) * (1.0 - left)
}

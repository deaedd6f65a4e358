//! Follows the gyro's case through space and integrates what its sensitive axis turns.

use crate::geometry::{self, ARCSEC_PER_RAD, BaseAngles, Mounting};
use crate::scenario::Gyro;
use nalgebra::{UnitQuaternion, Vector3};

/// Where the gyro is.
#[derive(Debug, Clone)]
pub struct Pose {
    /// How the base stands.
    pub angles: BaseAngles,
    /// Index angle, degrees counter-clockwise.
    pub index_deg: f64,
    /// How it is held against the base.
    hand: UnitQuaternion<f64>,
    /// Instrument coordinates to east, north, up.
    pub attitude: UnitQuaternion<f64>,
    /// Direction of the sensitive axis in east, north, up.
    pub axis: Vector3<f64>,
    case: UnitQuaternion<f64>,
}

/// What the gyro's case did in an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Inertial angle about the sensitive axis, arcsec, right-handed.
    pub turned_arcsec: f64,
    /// Change of the index angle, rad, counter-clockwise.
    pub index_change_rad: f64,
}

/// The gyro on the rotating Earth.
#[derive(Debug, Clone)]
pub struct PoseTracker {
    mounting: Mounting,
    earth_rad_s: Vector3<f64>,
    hand: UnitQuaternion<f64>,
    pose: Pose,
}

impl PoseTracker {
    /// Starts at these angles.
    pub fn new(latitude_deg: f64, gyro: &Gyro, angles: BaseAngles, index_deg: f64) -> Self {
        let mounting = Mounting::new(
            gyro.spindle_tilt_arcsec.map(|arcsec| arcsec / ARCSEC_PER_RAD),
            gyro.axis_elevation_arcsec / ARCSEC_PER_RAD,
        );
        let hand = UnitQuaternion::identity();
        let pose = Pose::new(angles, hand, index_deg, &mounting);
        Self { mounting, earth_rad_s: geometry::earth_rate_rad_s(latitude_deg), hand, pose }
    }

    /// The pose after the last move.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// From the next move on the instrument is held so: the rotation that takes its coordinates to those of the base.
    pub fn hold(&mut self, hand: UnitQuaternion<f64>) {
        self.hand = hand;
    }

    /// Moves to new angles within `dt_s`.
    pub fn move_to(&mut self, angles: BaseAngles, index_deg: f64, dt_s: f64) -> Turn {
        if angles == self.pose.angles && self.hand == self.pose.hand && index_deg == self.pose.index_deg {
            let turned_rad = self.earth_rad_s.dot(&self.pose.axis) * dt_s;
            return Turn { turned_arcsec: turned_rad * ARCSEC_PER_RAD, index_change_rad: 0.0 };
        }
        let next = Pose::new(angles, self.hand, index_deg, &self.mounting);
        let mean_axis = (self.pose.axis + next.axis) / 2.0;
        let turned_rad =
            self.mounting.turned_rad(&self.pose.case, &next.case) + self.earth_rad_s.dot(&mean_axis) * dt_s;
        let index_change_rad = (index_deg - self.pose.index_deg).to_radians();
        self.pose = next;
        Turn { turned_arcsec: turned_rad * ARCSEC_PER_RAD, index_change_rad }
    }
}

impl Pose {
    fn new(angles: BaseAngles, hand: UnitQuaternion<f64>, index_deg: f64, mounting: &Mounting) -> Self {
        let attitude = angles.attitude() * hand;
        let case = mounting.case(&attitude, index_deg.to_radians());
        Self { angles, index_deg, hand, attitude, axis: mounting.axis(&case), case }
    }
}

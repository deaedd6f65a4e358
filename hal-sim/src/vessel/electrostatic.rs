//! An electrostatic gyro: where its rotor points among the stars, and what the pick-offs read of that.

use nalgebra::{Rotation3, Unit, Vector3};

use super::globe;
use super::ship::{Instant, Step};
use crate::noise::{Source, Stream};

/// Standard deviations of a class of gyros.
#[derive(Clone, Copy, Debug)]
pub struct EsgClass {
    /// Each torque fixed to the case, and each that depends on the load, °/h (per g, per g²).
    pub coefficient_deg_h: f64,
    /// Drift that nothing explains, °/h, and its random walk, °/h/√h.
    pub drift_deg_h: f64,
    pub drift_growth_deg_h_per_sqrt_h: f64,
    /// Constant error of each sensor, each axis, and noise of a reading, arcseconds.
    pub pick_off_arcsec: f64,
    pub reading_arcsec: f64,
}

impl EsgClass {
    /// A gyro as it may be had today and as the source's time had it: drift that nothing explains 0.002 °/h, torques of 0.5 °/h
    /// that are calibrated, sensors with 20″, readings with 5″.
    pub const TYPICAL: Self = Self {
        coefficient_deg_h: 0.5,
        drift_deg_h: 0.002,
        drift_growth_deg_h_per_sqrt_h: 0.0005,
        pick_off_arcsec: 20.0,
        reading_arcsec: 5.0,
    };
    /// What a calibration on a stand leaves of each torque, °/h.
    pub const CALIBRATED_DEG_H: f64 = 0.002;
}

/// How the rotor is started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// Along the Earth's axis.
    Polar,
    /// In the plane of the equator.
    Equatorial,
}

/// A gyro with the errors that it has.
#[derive(Clone, Debug)]
pub struct Electrostatic {
    class: EsgClass,
    /// Among the stars: axes fixed to the Earth at time zero.
    pub direction: Vector3<f64>,
    case: Vector3<f64>,
    unbalance: f64,
    stiffness: f64,
    drift: Vector3<f64>,
    sensors: [Vector3<f64>; 6],
    noise: Stream,
}

impl Electrostatic {
    /// A gyro whose rotor points as ordered, but for `off_deg` of error in a random direction.
    pub fn new(class: EsgClass, orientation: Orientation, hour_angle_deg: f64, off_deg: f64, seed: u64) -> Self {
        let mut noise = Stream::new(seed, Source::Electrostatic);
        let equator = globe::turn(hour_angle_deg.to_radians() / globe::RATE_RAD_S) * Vector3::x();
        let ordered = match orientation {
            Orientation::Polar => globe::axis(),
            Orientation::Equatorial => equator,
        };
        let mut three = |sigma: f64| Vector3::from_fn(|_, _| sigma * noise.normal());
        let direction = Rotation3::new(three(off_deg.to_radians())) * ordered;
        let case = three(class.coefficient_deg_h);
        let load = three(class.coefficient_deg_h);
        let drift = three(class.drift_deg_h);
        let sensors = std::array::from_fn(|_| three(class.pick_off_arcsec / 206_264.806));
        Self { class, direction, case, unbalance: load.x, stiffness: load.y, drift, sensors, noise }
    }

    /// The rotor drifts over a step of the voyage that lasts `dt_s`.
    pub fn advance(&mut self, step: &Step, dt_s: f64) {
        let growth = self.class.drift_growth_deg_h_per_sqrt_h * (dt_s / 3600.0).sqrt();
        self.drift += Vector3::from_fn(|_, _| growth * self.noise.normal());
        let turned = self.drift_rad_s(step, dt_s) * dt_s;
        self.direction = (Rotation3::new(turned) * self.direction).normalize();
    }

    /// Its drift among the stars, rad/s.
    pub fn drift_rad_s(&self, step: &Step, dt_s: f64) -> Vector3<f64> {
        let to_stars = globe::turn(step.end.t_s) * block(&step.end);
        let force = to_stars * step.velocity_m_s / (dt_s * 9.80665);
        let torque = to_stars * self.case
            + force * self.unbalance
            + force * (self.stiffness * force.dot(&self.direction))
            + self.drift;
        torque * (1.0f64 / 3600.0).to_radians()
    }

    /// What a calibration with errors of `sigma_deg_h` finds: three torques of the case, unbalance, stiffness, °/h.
    pub fn coefficients_deg_h(&self, sigma_deg_h: f64, seed: u64) -> [f64; 5] {
        let mut noise = Stream::new(seed ^ 0xca11, Source::Electrostatic);
        [self.case.x, self.case.y, self.case.z, self.unbalance, self.stiffness]
            .map(|value| value + sigma_deg_h * noise.normal())
    }

    /// The rotor in block axes as it is read, and the sensor that reads it: that nearest to the rotor's axis.
    pub fn read(&mut self, at: &Instant) -> (Vector3<f64>, u8) {
        let seen = (globe::turn(at.t_s) * block(at)).inverse() * self.direction;
        let axis = seen.iamax();
        let sensor = 2 * axis + usize::from(seen[axis] < 0.0);
        let noise = self.class.reading_arcsec / 206_264.806;
        let read = seen + self.sensors[sensor] + Vector3::from_fn(|_, _| noise * self.noise.normal());
        (read, sensor as u8)
    }
}

/// Block axes to axes fixed to the Earth.
fn block(at: &Instant) -> Rotation3<f64> {
    at.hull * Rotation3::from_axis_angle(&Unit::new_unchecked(Vector3::z()), at.turn_rad)
}

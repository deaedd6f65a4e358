//! The electrostatic gyro in the aided filter: a virtual gyro runs beside the real one, and what the pick-offs read of the real one
//! is compared with it, in two components across the rotor's momentum.
//!
//! With the attitude A (block axes to east, north, up), the axes G of the place (east, north, up to inertial ones), the pick-offs' error
//! p, the momentum h and an axis e across it, e·G·A·(read − p) − e·h is δ_e less what errors of attitude φ and of place ψ = (−δN/M,
//! δE/P, δE·tan φ/P) turn of it: (φ + ψ)·(w × ε), w = A·(read − p), ε = Gᵀ·e. All of it is in one filter, so that a heading that
//! came from the gyro does not count twice, and one that comes from satellites tells the gyro's drift.

use libm::sqrt;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::Filter;
use super::measurement::{Row, Rows, SECOND_ORDER};
use super::state::{ATTITUDE, ESG_COEFFICIENT, ESG_DIRECTION, ESG_DRIFT, ESG_PICK_OFF, Errors, POSITION, STATES};
use crate::esg::filter::{EsgErrors, PickOff};
use crate::esg::reference::{COEFFICIENTS, DriftCoefficients, Reference};
use crate::esg::sky;

/// What errors leave beyond the first order stays the same for so many readings in a row.
const SECOND_ORDER_REPEATS: f64 = 60.0;

/// The gyro's part of the filter.
#[derive(Clone, Debug)]
pub(super) struct Electrostatic {
    reference: Reference,
    errors: EsgErrors,
    pick_off: Vector3<f64>,
    sensor: Option<u8>,
}

impl Electrostatic {
    pub(super) fn feed_back(&mut self, x: &Errors) {
        self.reference.correct(&x.fixed_rows::<2>(ESG_DIRECTION).into_owned());
        self.pick_off += x.fixed_rows::<3>(ESG_PICK_OFF);
        self.reference.residual_rad_s += x.fixed_rows::<2>(ESG_DRIFT);
        let DriftCoefficients { block: [bx, by, bz], unbalance, stiffness } = &mut self.reference.coefficients;
        for (coefficient, x) in [bx, by, bz, unbalance, stiffness].into_iter().zip(x.iter().skip(ESG_COEFFICIENT)) {
            *coefficient += x;
        }
    }
}

impl Filter {
    /// An electrostatic gyro is there from now on, its momentum along `direction`: inertial axes, those of the Earth when the filter
    /// began.
    pub fn add_electrostatic(&mut self, direction: &Vector3<f64>, coefficients: DriftCoefficients, errors: EsgErrors) {
        self.covariance.use_first(STATES);
        for (first, count, sigma) in [
            (ESG_DIRECTION, 2, errors.direction_rad),
            (ESG_PICK_OFF, 3, errors.pick_off_rad),
            (ESG_DRIFT, 2, errors.drift_rad_s),
            (ESG_COEFFICIENT, COEFFICIENTS, errors.coefficient_rad_s),
        ] {
            for state in first..first + count {
                self.covariance.add_noise(state, sigma * sigma);
            }
        }
        let reference = Reference::new(direction, coefficients);
        self.electrostatic = Some(Electrostatic { reference, errors, pick_off: Vector3::zeros(), sensor: None });
    }

    /// The virtual gyro as it is now.
    pub fn virtual_gyro(&self) -> Option<&Reference> {
        self.electrostatic.as_ref().map(|gyro| &gyro.reference)
    }

    /// East, north, up to inertial axes.
    fn to_inertial(&self) -> Matrix3<f64> {
        let navigation = &self.navigation;
        sky::inertial_to_geographic(navigation.latitude_rad, navigation.longitude_rad, self.time_s).transpose()
    }

    /// The virtual gyro and its errors over `dt_s`.
    pub(super) fn advance_electrostatic(&mut self, dt_s: f64) {
        let block = self.to_inertial() * self.navigation.attitude;
        let up_g = self.navigation.attitude.row(2).transpose();
        let Some(gyro) = &mut self.electrostatic else { return };
        let (a, b) = gyro.reference.plane();
        for (state, along) in [(ESG_DRIFT + 1, ESG_DIRECTION), (ESG_DRIFT, ESG_DIRECTION + 1)] {
            self.covariance.shear(along, state, dt_s);
        }
        for (number, part) in gyro.reference.drift_by_coefficient(&block, &up_g).iter().enumerate() {
            self.covariance.shear(ESG_DIRECTION, ESG_COEFFICIENT + number, -part.dot(&b) * dt_s);
            self.covariance.shear(ESG_DIRECTION + 1, ESG_COEFFICIENT + number, part.dot(&a) * dt_s);
        }
        let growth = gyro.errors.drift_growth_rad_s_per_sqrt_s;
        for state in ESG_DRIFT..ESG_COEFFICIENT {
            self.covariance.add_noise(state, growth * growth * dt_s);
        }
        gyro.reference.advance(dt_s, &block, &up_g);
    }

    /// Another sensor has errors of its own: what was known of the last one's is forgotten.
    pub(super) fn follow_sensor(&mut self, sensor: u8) {
        let Some(gyro) = &mut self.electrostatic else { return };
        if gyro.sensor.replace(sensor).is_some_and(|last| last != sensor) {
            gyro.pick_off = Vector3::zeros();
            for state in ESG_PICK_OFF..ESG_DRIFT {
                self.covariance.renew(state, gyro.errors.pick_off_rad);
            }
        }
    }

    pub(super) fn pick_off_rows(&self, reading: &PickOff) -> Rows {
        let Some(gyro) = &self.electrostatic else { return [const { None }; 4] };
        let to_inertial = self.to_inertial();
        let geographic = self.navigation.attitude * (reading.direction - gyro.pick_off);
        let off = to_inertial * geographic - gyro.reference.direction();
        let place = self.navigation.place();
        let variances = [ATTITUDE + 2, ESG_DIRECTION, ESG_DIRECTION + 1].map(|state| self.covariance.variance(state));
        let bent = SECOND_ORDER * variances.iter().sum::<f64>() * sqrt(SECOND_ORDER_REPEATS);
        let variance = gyro.errors.reading_rad * gyro.errors.reading_rad + bent * bent;
        let (a, b) = gyro.reference.plane();
        let row = |state: usize, axis: &Vector3<f64>| {
            let local = to_inertial.transpose() * axis;
            let turned = geographic.cross(&local);
            let east = (turned.y + turned.z * place.tan_latitude) / place.prime_vertical_m;
            let north = -turned.x / place.meridian_m;
            let mut h = Errors::zeros();
            h.fixed_rows_mut::<3>(ATTITUDE).copy_from(&-turned);
            h.fixed_rows_mut::<2>(POSITION).copy_from(&-Vector2::new(east, north));
            h.fixed_rows_mut::<3>(ESG_PICK_OFF).copy_from(&(self.navigation.attitude.transpose() * local));
            crate::ud::put(&mut h, state, 1.0);
            Some(Row { h, value: off.dot(axis), variance })
        };
        [row(ESG_DIRECTION, &a), row(ESG_DIRECTION + 1, &b), None, None]
    }
}

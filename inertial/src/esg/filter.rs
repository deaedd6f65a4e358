//! The electrostatic gyro's filter: errors of the virtual gyro, of the pick-offs, of the drift model.
//!
//! Seven states for a short readiness time: two errors of the direction, pick-off errors of three axes, two drifts that wander
//! (Wiener processes). Twelve with the five coefficients of the drift, after a calibration on a stand.

use libm::sqrt;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::reference::{DriftCoefficients, Reference};
use super::sky;
use crate::ud::{Ud, put, unit};

/// Errors of the direction: δ1 along axis 1, δη along the rise (δh2 = −δη·sin θ), rad.
const DIRECTION: usize = 0;
/// Pick-off errors, block axes, rad.
const PICK_OFF: usize = 2;
/// Drifts beyond the model: x6 = Δω1, x7 = Δω*, rad/s.
const DRIFT: usize = 5;
/// Drift coefficients, rad/s.
const COEFFICIENT: usize = 7;

/// Readings further off than this many standard deviations are outliers.
const GATE_SIGMAS: f64 = 5.0;

/// Seven states.
pub type SevenStates = EsgFilter<7, 5, 28>;
/// Twelve states, with the drift coefficients.
pub type TwelveStates = EsgFilter<12, 10, 78>;

/// Standard deviations of the gyro, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EsgErrors {
    /// Direction at the start, each component, rad.
    pub direction_rad: f64,
    /// Constant error of a pick-off, each axis, rad.
    pub pick_off_rad: f64,
    /// Noise of a reading, rad.
    pub reading_rad: f64,
    /// Drift beyond the model at the start, rad/s, and its growth, rad/s/√s.
    pub drift_rad_s: f64,
    pub drift_growth_rad_s_per_sqrt_s: f64,
    /// Each coefficient of the drift, rad/s.
    pub coefficient_rad_s: f64,
}

/// A reading of the pick-offs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickOff {
    /// Direction of the rotor's momentum, block axes.
    pub direction: Vector3<f64>,
    /// Which of the six sensors reads: it changes where the rotor is more than 45° from one.
    pub sensor: u8,
}

/// Heading by the gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EsgHeading {
    /// What has to be added to the heading of the attitude that was given, rad.
    pub correction_rad: f64,
    /// One standard deviation of the corrected heading, rad.
    pub sigma_rad: f64,
}

/// Place, time and attitude for a heading, with their standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    pub latitude_rad: f64,
    pub longitude_rad: f64,
    /// Since the inertial axes were those of the Earth.
    pub time_s: f64,
    /// Block axes to east, north, up, with a heading that may be off.
    pub attitude: Matrix3<f64>,
    /// About each horizontal axis, rad.
    pub tilt_sigma_rad: f64,
    /// East and north each, as an angle at the Earth's centre, rad.
    pub place_sigma_rad: f64,
}

/// The filter; `OTHERS` is `N` − 2, `PACKED` is `N(N + 1)/2`.
#[derive(Clone, Debug)]
pub struct EsgFilter<const N: usize, const OTHERS: usize, const PACKED: usize> {
    reference: Reference,
    pick_off: Vector3<f64>,
    errors: EsgErrors,
    covariance: Ud<N, PACKED>,
    sensor: Option<u8>,
    rejected: u32,
    jumps: u32,
}

impl<const N: usize, const OTHERS: usize, const PACKED: usize> EsgFilter<N, OTHERS, PACKED> {
    /// Starts with the virtual gyro.
    pub fn new(reference: Reference, errors: EsgErrors) -> Self {
        let sigmas = SVector::<f64, N>::from_fn(|state, _| match state {
            DIRECTION..PICK_OFF => errors.direction_rad,
            PICK_OFF..DRIFT => errors.pick_off_rad,
            DRIFT..COEFFICIENT => errors.drift_rad_s,
            _ => errors.coefficient_rad_s,
        });
        let covariance = Ud::diagonal(&sigmas);
        Self { reference, pick_off: Vector3::zeros(), errors, covariance, sensor: None, rejected: 0, jumps: 0 }
    }

    /// `dt_s` on; `block` takes block axes to inertial ones, `force_g` is the specific force in block axes, g.
    pub fn advance(&mut self, dt_s: f64, block: &Matrix3<f64>, force_g: &Vector3<f64>) {
        let (a, b) = self.reference.plane();
        let mut coupling = SMatrix::<f64, 2, OTHERS>::zeros();
        let mut put = |row: usize, state: usize, value: f64| {
            if let Some(place) = coupling.get_mut((row, state - 2)) {
                *place = value;
            }
        };
        put(1, DRIFT, dt_s);
        put(0, DRIFT + 1, dt_s);
        for (number, part) in self.reference.drift_by_coefficient(block, force_g).iter().enumerate() {
            // Seven states have no coefficients.
            put(0, COEFFICIENT + number, -part.dot(&b) * dt_s);
            put(1, COEFFICIENT + number, part.dot(&a) * dt_s);
        }
        self.covariance.lead::<2, OTHERS, 4>(&Matrix2::identity(), &coupling, &Vector2::zeros());
        let growth = self.errors.drift_growth_rad_s_per_sqrt_s;
        for state in DRIFT..COEFFICIENT {
            self.covariance.add_noise(state, growth * growth * dt_s);
        }
        self.reference.advance(dt_s, block, force_g);
    }

    /// Compares a reading with the virtual gyro, at an attitude (block to inertial axes) known to `attitude_sigma_rad`.
    /// Returns the normalised squared innovation of both components, none if it was rejected as an outlier.
    pub fn measure(&mut self, reading: &PickOff, block: &Matrix3<f64>, attitude_sigma_rad: f64) -> Option<f64> {
        self.follow(reading.sensor);
        let (a, b) = self.reference.plane();
        let read = block * (reading.direction - self.pick_off);
        let noise = self.errors.reading_rad;
        let variance = attitude_sigma_rad * attitude_sigma_rad + noise * noise;
        let rows = [(DIRECTION, a), (DIRECTION + 1, b)].map(|(state, along)| {
            let mut h = unit::<N>(state);
            h.fixed_rows_mut::<3>(PICK_OFF).copy_from(&(block.transpose() * along));
            (h, (read - self.reference.direction()).dot(&along))
        });
        let zero = SVector::<f64, N>::zeros();
        let limit = GATE_SIGMAS * GATE_SIGMAS;
        let good = |(h, value): &(SVector<f64, N>, f64)| {
            self.covariance.innovation(&zero, h, *value, variance).normalised_squared() <= limit
        };
        if !(variance > 0.0) || !rows.iter().all(good) {
            self.rejected += 1;
            return None;
        }
        let mut x = zero;
        let mut normalised_squared = 0.0;
        for (h, value) in &rows {
            normalised_squared += self.covariance.innovation(&x, h, *value, variance).normalised_squared();
            self.covariance.update(&mut x, h, *value, variance);
        }
        self.feed_back(&x);
        Some(normalised_squared)
    }

    /// Another sensor has errors of its own: what was known of the last one's is forgotten.
    fn follow(&mut self, sensor: u8) {
        if self.sensor.is_some_and(|last| last != sensor) {
            self.jumps += 1;
            self.pick_off = Vector3::zeros();
            for state in PICK_OFF..DRIFT {
                self.covariance.renew(state, self.errors.pick_off_rad);
            }
        }
        self.sensor = Some(sensor);
    }

    fn feed_back(&mut self, x: &SVector<f64, N>) {
        self.reference.correct(&Vector2::new(x[DIRECTION], x[DIRECTION + 1]));
        self.pick_off += x.fixed_rows::<3>(PICK_OFF);
        self.reference.residual_rad_s += x.fixed_rows::<2>(DRIFT);
        let DriftCoefficients { block: [bx, by, bz], unbalance, stiffness } = &mut self.reference.coefficients;
        for (coefficient, x) in [bx, by, bz, unbalance, stiffness].into_iter().zip(x.iter().skip(COEFFICIENT)) {
            *coefficient += x;
        }
    }

    /// Heading by the reading and by where the direction stands over the place.
    pub fn heading(&self, reading: &PickOff, at: &Situation) -> Option<EsgHeading> {
        let to_geographic = sky::inertial_to_geographic(at.latitude_rad, at.longitude_rad, at.time_s);
        let expected = to_geographic * self.reference.direction();
        let read = at.attitude * (reading.direction - self.pick_off);
        let (correction_rad, level) = sky::turn_to(&read, &expected)?;
        // Across the direction in the horizontal plane: only errors along it move the heading.
        let across = Vector3::new(-expected.y, expected.x, 0.0) / level;
        let (a, b) = self.reference.plane();
        let mut h = SVector::<f64, N>::zeros();
        put(&mut h, DIRECTION, (to_geographic * a).dot(&across));
        put(&mut h, DIRECTION + 1, (to_geographic * b).dot(&across));
        let known = self.sensor == Some(reading.sensor);
        if known {
            h.fixed_rows_mut::<3>(PICK_OFF).copy_from(&(at.attitude.transpose() * across));
        }
        let unknown = if known { 0.0 } else { self.errors.pick_off_rad };
        // East by 1 rad turns the axes about north by 1 and about up by tan φ, north about west.
        let tangent = libm::tan(at.latitude_rad);
        let east = Vector3::new(0.0, 1.0, tangent).cross(&expected).dot(&across);
        let north = Vector3::new(-1.0, 0.0, 0.0).cross(&expected).dot(&across);
        let variance = self.covariance.variance_of(&h)
            + unknown * unknown
            + self.errors.reading_rad * self.errors.reading_rad
            + at.tilt_sigma_rad * at.tilt_sigma_rad * expected.z * expected.z
            + at.place_sigma_rad * at.place_sigma_rad * (east * east + north * north);
        Some(EsgHeading { correction_rad, sigma_rad: sqrt(variance) / level })
    }

    /// The virtual gyro as it is now.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Readings rejected, and changes from one sensor to another.
    pub fn counters(&self) -> (u32, u32) {
        (self.rejected, self.jumps)
    }
}

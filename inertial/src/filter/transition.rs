//! The error equations: how the errors grow over an interval.
//!
//! With φ the rotation from the computed to the true geographic axes and δ truth less estimate:
//! φ' = −ω×φ − δω − C·(gyro errors), δv' = φ×f − C·(accelerometer bias) − (2Ω + ρ)×δv − (2δΩ + δρ)×v + δg, δr' = δv + what
//! the turning of the geographic axes makes of δr. D. H. Titterton, J. L. Weston, Strapdown Inertial Navigation Technology,
//! 2nd edition 2004, chapter 12, with the opposite sign of φ.

use nalgebra::{Matrix3, Matrix3x2, SMatrix, SVector, Vector3};

use super::block::BlockErrors;
use super::navigation::{Navigation, Place};
use super::state::{
    ACCELEROMETER, ATTITUDE, LEAD, MARKOV, ORTHOGONALITY, OTHERS, POSITION, RHUMB, RUN_TO_RUN, SCALE, STATES, VELOCITY,
};

/// What of the motion the error equations need, summed over an interval.
#[derive(Clone, Debug)]
pub struct Interval {
    /// Length, s.
    pub dt_s: f64,
    axes_s: Matrix3<f64>,
    scale_rad: Matrix3<f64>,
    orthogonality_rad: Matrix3<f64>,
    hull_s: Matrix3x2<f64>,
    force_m_s: Vector3<f64>,
}

/// How the errors at the end of an interval follow from those at its beginning.
#[derive(Clone, Debug)]
pub struct Transition {
    /// Length of the interval, s.
    pub dt_s: f64,
    /// Leading states on leading states.
    pub phi: SMatrix<f64, LEAD, LEAD>,
    /// Leading states on the others.
    pub coupling: SMatrix<f64, LEAD, OTHERS>,
    /// Variances that white noise adds to the leading states.
    pub noise: SVector<f64, LEAD>,
}

impl Interval {
    /// Nothing yet.
    pub fn empty() -> Self {
        Self {
            dt_s: 0.0,
            axes_s: Matrix3::zeros(),
            scale_rad: Matrix3::zeros(),
            orthogonality_rad: Matrix3::zeros(),
            hull_s: Matrix3x2::zeros(),
            force_m_s: Vector3::zeros(),
        }
    }

    /// Adds one step: the attitudes of block and hull in its middle, its angle increment, the specific force's integral in
    /// geographic axes.
    pub fn add(
        &mut self,
        dt_s: f64,
        block: &Matrix3<f64>,
        hull: &Matrix3<f64>,
        angle: &Vector3<f64>,
        force_m_s: &Vector3<f64>,
    ) {
        self.dt_s += dt_s;
        self.axes_s += block * dt_s;
        self.scale_rad +=
            Matrix3::from_columns(&[block.column(0) * angle.x, block.column(1) * angle.y, block.column(2) * angle.z]);
        self.orthogonality_rad +=
            Matrix3::from_columns(&[block.column(0) * angle.y, block.column(0) * angle.z, block.column(1) * angle.z]);
        self.hull_s += hull.fixed_columns::<2>(0) * dt_s;
        self.force_m_s += force_m_s;
    }

    /// Mean specific force in geographic axes, m/s²; none of an empty interval.
    pub fn force_m_s2(&self) -> Option<Vector3<f64>> {
        (self.dt_s > 0.0).then(|| self.force_m_s / self.dt_s)
    }

    /// The transition over the interval, which ends where `navigation` is.
    ///
    /// `force_sigma_m_s2` is how well the horizontal specific force is known.
    pub fn transition(
        &self,
        navigation: &Navigation,
        block: &BlockErrors,
        force_sigma_m_s2: f64,
    ) -> Option<Transition> {
        let force = significant(&self.force_m_s2()?, force_sigma_m_s2);
        let f = dynamics(&navigation.place(), &navigation.velocity_m_s, &force) * self.dt_s;
        let mut direct = SMatrix::<f64, LEAD, OTHERS>::zeros();
        let mut put = |row: usize, state: usize, block: &Matrix3<f64>| {
            direct.fixed_view_mut::<3, 3>(row, state - LEAD).copy_from(&-block);
        };
        put(ATTITUDE, MARKOV, &self.axes_s);
        put(ATTITUDE, RUN_TO_RUN, &self.axes_s);
        put(ATTITUDE, SCALE, &self.scale_rad);
        put(ATTITUDE, ORTHOGONALITY, &self.orthogonality_rad);
        put(VELOCITY, ACCELEROMETER, &self.axes_s);
        direct.fixed_view_mut::<3, 2>(ATTITUDE, RHUMB - LEAD).copy_from(&-self.hull_s);
        let identity = SMatrix::<f64, LEAD, LEAD>::identity();
        let square = f * f;
        let gyro = block.gyro_white_rad_per_sqrt_s * block.gyro_white_rad_per_sqrt_s * self.dt_s;
        let accelerometer =
            block.accelerometer_white_m_s_per_sqrt_s * block.accelerometer_white_m_s_per_sqrt_s * self.dt_s;
        Some(Transition {
            dt_s: self.dt_s,
            phi: identity + f + 0.5 * square,
            coupling: (identity + 0.5 * f + square / 6.0) * direct,
            noise: SVector::from_fn(|row, _| match row {
                0..VELOCITY => gyro,
                VELOCITY..POSITION => accelerometer,
                _ => 0.0,
            }),
        })
    }
}

/// The specific force with its horizontal part only as far as it stands out of its own uncertainty.
///
/// At rest it is what the readings' noise makes of the tilt, corrected to and fro; a heading error would show against a true
/// acceleration, so that a filter that takes this one for true believes to see its heading (simulated at a mooring: 3.3°
/// claimed, 13° true after 4 h). Twelve sigmas count in full within 1 %, one counts nothing.
fn significant(force: &Vector3<f64>, sigma: f64) -> Vector3<f64> {
    let square = force.x * force.x + force.y * force.y;
    let limit = 16.0 * sigma * sigma;
    let share = square * square / (square * square + limit * limit);
    let share = if share.is_nan() { 1.0 } else { share };
    Vector3::new(force.x * share, force.y * share, force.z)
}

impl Transition {
    /// Rates of the three velocity errors by all errors, 1/s and mixed units.
    pub fn velocity_rate(&self) -> SMatrix<f64, 3, STATES> {
        let mut rate = SMatrix::<f64, 3, STATES>::zeros();
        let change = self.phi - SMatrix::<f64, LEAD, LEAD>::identity();
        rate.fixed_columns_mut::<LEAD>(0).copy_from(&(change.fixed_rows::<3>(VELOCITY) / self.dt_s));
        rate.fixed_columns_mut::<OTHERS>(LEAD).copy_from(&(self.coupling.fixed_rows::<3>(VELOCITY) / self.dt_s));
        rate
    }
}

/// F of the leading states, 1/s and mixed units.
fn dynamics(place: &Place, velocity: &Vector3<f64>, force: &Vector3<f64>) -> SMatrix<f64, LEAD, LEAD> {
    let (meridian, prime, tangent) = (place.meridian_m, place.prime_vertical_m, place.tan_latitude);
    let earth = place.earth_rad_s;
    let transport = place.transport_rad_s(velocity);
    // Changes of the axes' rate with velocity and with position.
    let transport_by_velocity =
        Matrix3::new(0.0, -1.0 / meridian, 0.0, 1.0 / prime, 0.0, 0.0, tangent / prime, 0.0, 0.0);
    let secant_2 = 1.0 + tangent * tangent;
    let transport_by_position = Matrix3::new(
        0.0,
        0.0,
        velocity.y / (meridian * meridian),
        0.0,
        0.0,
        -velocity.x / (prime * prime),
        0.0,
        velocity.x * secant_2 / (prime * meridian),
        -velocity.x * tangent / (prime * prime),
    );
    let earth_by_position = Matrix3::new(0.0, 0.0, 0.0, 0.0, -earth.z / meridian, 0.0, 0.0, earth.y / meridian, 0.0);
    let v = velocity.cross_matrix();
    let mut f = SMatrix::<f64, LEAD, LEAD>::zeros();
    let mut put = |row: usize, column: usize, block: Matrix3<f64>| {
        f.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
    };
    put(ATTITUDE, ATTITUDE, -(earth + transport).cross_matrix());
    put(ATTITUDE, VELOCITY, -transport_by_velocity);
    put(ATTITUDE, POSITION, -(transport_by_position + earth_by_position));
    put(VELOCITY, ATTITUDE, -force.cross_matrix());
    put(VELOCITY, VELOCITY, v * transport_by_velocity - (2.0 * earth + transport).cross_matrix());
    let (towards_north, upwards) = (-place.gravity_growth_1_s2, 2.0 * place.gravity_m_s2 / meridian);
    let gravity_by_position = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, towards_north, upwards);
    put(VELOCITY, POSITION, v * (transport_by_position + 2.0 * earth_by_position) + gravity_by_position);
    put(POSITION, VELOCITY, Matrix3::identity());
    put(
        POSITION,
        POSITION,
        Matrix3::new(
            // Metres to the east shrink towards the pole, and every metre on the ground with the height.
            -velocity.y * tangent / meridian + velocity.z / prime,
            velocity.x * tangent / meridian,
            -velocity.x / prime,
            0.0,
            velocity.z / meridian,
            -velocity.y / meridian,
            0.0,
            0.0,
            0.0,
        ),
    );
    f
}

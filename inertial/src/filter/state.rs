//! The error states of the aided filter: their order, names and units.
//!
//! An error is truth less estimate: what has to be added to the estimate. Geographic axes are east, north, up; block axes
//! those of the gyro triad; hull axes X to starboard, Y forward, Z up.

use nalgebra::SVector;

/// Number of error states with an electrostatic gyro.
pub const STATES: usize = 47;
/// … and without one.
pub const AIDED: usize = ESG_DIRECTION;
/// Entries of the triangular factor of their covariance.
pub const PACKED: usize = STATES * (STATES + 1) / 2;
/// The leading states, that move by the equations of navigation: attitude, velocity, position.
pub const LEAD: usize = 9;
/// The others: constants and Gauss-Markov processes.
pub const OTHERS: usize = STATES - LEAD;

/// Rotation of the computed geographic axes to the true ones about east, north, up, rad.
pub const ATTITUDE: usize = 0;
/// Velocity over the ground, m/s.
pub const VELOCITY: usize = 3;
/// Position, m.
pub const POSITION: usize = 6;
/// Gyro drift, Gauss-Markov, block axes, rad/s.
pub const MARKOV: usize = 9;
/// Water current towards east and north, Gauss-Markov, m/s.
pub const CURRENT: usize = 12;
/// Gyro drift that is constant from switch-on, block axes, rad/s.
pub const RUN_TO_RUN: usize = 14;
/// Gyro scale factors.
pub const SCALE: usize = 17;
/// Gyro orthogonality: y into x, z into x, z into y, rad.
pub const ORTHOGONALITY: usize = 20;
/// Rhumb drift about the hull's X and Y, rad/s.
pub const RHUMB: usize = 23;
/// Accelerometer bias, block axes, m/s².
pub const ACCELEROMETER: usize = 25;
/// Scale factor of the log.
pub const LOG_SCALE: usize = 28;
/// Antenna baseline along the hull's Y and Z, m.
pub const BASELINE: usize = 29;
/// Ambiguities of the phase differences, m.
pub const AMBIGUITY: usize = 31;
/// Phase differences at a time.
pub const PHASES: usize = ESG_DIRECTION - AMBIGUITY;
/// Direction of the virtual electrostatic gyro's momentum: along axis 1 and along the rise, rad.
pub const ESG_DIRECTION: usize = 35;
/// Error of its pick-offs, block axes, rad.
pub const ESG_PICK_OFF: usize = 37;
/// Its drifts beyond the model: x6 = Δω1, x7 = Δω*, rad/s.
pub const ESG_DRIFT: usize = 40;
/// Its drift coefficients: three torques fixed to the block, unbalance for 1 g, stiffness for 1 g², rad/s.
pub const ESG_COEFFICIENT: usize = 42;

/// A vector of all error states.
pub type Errors = SVector<f64, STATES>;

/// A group of states with what a person calls it.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// Name with its axes.
    pub name: &'static str,
    /// Unit of [`Group::scale`].
    pub unit: &'static str,
    /// First state.
    pub first: usize,
    /// Number of states.
    pub count: usize,
    /// From SI to the unit.
    pub scale: f64,
}

const DEG: f64 = quantities::units::DEG_PER_RAD;

/// All groups in the order of the states.
pub const GROUPS: [Group; 17] = [
    Group { name: "attitude about east, north, up", unit: "°", first: ATTITUDE, count: 3, scale: DEG },
    Group { name: "velocity east, north, up", unit: "m/s", first: VELOCITY, count: 3, scale: 1.0 },
    Group { name: "position east, north, up", unit: "m", first: POSITION, count: 3, scale: 1.0 },
    Group { name: "gyro Markov drift x, y, z", unit: "°/h", first: MARKOV, count: 3, scale: DEG * 3600.0 },
    Group { name: "current east, north", unit: "m/s", first: CURRENT, count: 2, scale: 1.0 },
    Group { name: "gyro run-to-run drift x, y, z", unit: "°/h", first: RUN_TO_RUN, count: 3, scale: DEG * 3600.0 },
    Group { name: "gyro scale x, y, z", unit: "%", first: SCALE, count: 3, scale: 100.0 },
    Group { name: "orthogonality yx, zx, zy", unit: "″", first: ORTHOGONALITY, count: 3, scale: DEG * 3600.0 },
    Group { name: "rhumb drift X, Y", unit: "°/h", first: RHUMB, count: 2, scale: DEG * 3600.0 },
    Group { name: "accelerometer bias x, y, z", unit: "m/s²", first: ACCELEROMETER, count: 3, scale: 1.0 },
    Group { name: "log scale", unit: "%", first: LOG_SCALE, count: 1, scale: 100.0 },
    Group { name: "baseline Y, Z", unit: "m", first: BASELINE, count: 2, scale: 1.0 },
    Group { name: "ambiguities", unit: "m", first: AMBIGUITY, count: PHASES, scale: 1.0 },
    Group { name: "ESG direction", unit: "″", first: ESG_DIRECTION, count: 2, scale: DEG * 3600.0 },
    Group { name: "ESG pick-offs x, y, z", unit: "″", first: ESG_PICK_OFF, count: 3, scale: DEG * 3600.0 },
    Group { name: "ESG drift", unit: "°/h", first: ESG_DRIFT, count: 2, scale: DEG * 3600.0 },
    Group { name: "ESG drift coefficients", unit: "°/h", first: ESG_COEFFICIENT, count: 5, scale: DEG * 3600.0 },
];

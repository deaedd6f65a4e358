//! Calibrations: six positions for a gyro triad, an ellipsoid for an accelerometer triad.
//!
//! Both are least squares over means of stays at rest; both say how sure each parameter is, and refuse sets that cannot
//! say it, with the reason.

pub mod accelerometer;
pub mod ellipsoid;
pub mod field;
pub mod six_position;
pub mod statistics;
pub mod still;

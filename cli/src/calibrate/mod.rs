//! Calibrations on the host: recordings to what the core solves, and results to files.

pub mod columns;
pub mod ellipsoid;
mod manifest;
pub mod model_file;
mod motion;
pub mod six_position;

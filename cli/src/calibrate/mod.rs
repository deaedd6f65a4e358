//! Calibrations on the host: recordings to what the core solves, and results to files.

pub mod attitudes;
pub mod columns;
pub mod ellipsoid;
pub mod known_attitudes;
mod manifest;
mod motion;
pub mod norm_fit;
pub mod six_position;

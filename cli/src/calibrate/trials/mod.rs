//! How good calibrations are, by Monte Carlo: simulated triads of an independent world, calibrated by the core.

pub mod ellipsoid;
mod least;
pub mod navigation;
pub mod six_position;
mod tally;
pub mod triads;
pub mod voyage;

pub use least::Truth;
pub use tally::{Parameter, Tally};

//! How good calibrations are, by Monte Carlo: simulated triads of an independent world, calibrated by the core.

mod bound;
pub mod ellipsoid;
pub mod navigation;
pub mod six_position;
mod tally;
pub mod voyage;

pub use bound::Truth;
pub use tally::{Parameter, Tally};

//! Single trials of a Monte Carlo: simulated triads of an independent world, calibrated by the core; the aided filter on a
//! simulated ship.

pub mod ageing;
pub mod aided;
mod bound;
pub mod carried;
pub mod dive;
pub mod ellipsoid;
pub mod navigation;
pub mod six_position;
mod tally;
pub mod traditional;
pub mod voyage;

pub use bound::Truth;
pub use tally::{Parameter, Tally};

//! How accurate the azimuth is, by Monte Carlo: simulated fixes of an independent world, solved by the firmware's replay.

mod case;
mod statistics;
mod trial;

pub use case::{Case, EVEN_S, Noise, Order, REVERSAL_S, Spread};
pub use statistics::{Statistics, confidence_95};
pub use trial::{Trial, run};

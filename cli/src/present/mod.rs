//! A fix for people: live while it runs, and its result.

mod angle;
pub mod guidance;
mod live;
mod result;
pub mod self_test;

pub use angle::{AngleUnit, Asked, Directions};
pub use live::{Lines, View, place};
pub use result::{Reference, write_fault, write_fix, write_held};

//! A fix for people: live while it runs, and its result.

mod flags;
pub mod guidance;
mod live;
mod result;

pub use flags::explain;
pub use live::View;
pub use result::{Reference, write_fault, write_fix};

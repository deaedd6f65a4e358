//! The north finder in a browser page: the firmware's core and the simulated instrument on a [`bench`](Bench) that a person works
//! at, and the three functions by which the page's script reaches it (`exports`).

mod bench;
mod exports;
mod report_json;

pub use bench::{Act, Answer, Bench, Chosen};
pub use report_json::{Reported, Word};

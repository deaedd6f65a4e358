//! The diagnosis tested on effects that nothing declares: campaigns of the simulator's generator, an oracle that knows
//! what is hidden in them, and a judge.

mod files;
mod judge;
mod linear;
mod oracle;
mod statistics;

pub use files::{Folder, write};
pub use judge::{Attribution, Errors, Verdict, judge};
pub use oracle::{Oracle, consult};
pub use statistics::{Interval, Summary, summarize};

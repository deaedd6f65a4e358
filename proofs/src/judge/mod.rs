//! The diagnosis tested on hidden effects: campaigns of the generator written as files, an oracle that knows what is hidden
//! in them, and a judge.

mod files;
mod linear;
mod oracle;
mod statistics;
mod verdict;

pub use files::write;
pub use oracle::{Oracle, consult};
pub use statistics::{Interval, Summary, summarize};
pub use verdict::{Attribution, Errors, Verdict, judge};

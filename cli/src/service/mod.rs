//! An instrument in service: the log of its fixes, and whether its error model still holds.

mod board;
mod coefficient;
mod history;
mod log;
mod remedy;
pub mod report;
mod signals;
mod watch;

pub use board::BoardLog;
pub use coefficient::{Moved, OtherPlace};
pub use history::History;
pub use log::{Log, Logged, write_log};
pub use remedy::Needed;
pub use signals::{Kind, Lacking, Signal, signals};
pub use watch::{ALARM, BASELINE, Cause, Change, Watch, watch};

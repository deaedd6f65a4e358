//! An instrument in service: the log of its fixes, and whether its error model still holds.

mod log;
mod signals;
mod watch;

pub use log::{Log, Logged, write_log};
pub use signals::{Kind, Signal, signals};
pub use watch::{ALARM, BASELINE, Cause, Change, Watch, watch};

//! The state machine of a fix.

pub mod order;

//! Calibrations: six positions for a gyro triad; known attitudes, or an ellipsoid, for an accelerometer triad.
//!
//! All are least squares over means at rest; all say how sure each parameter is, and refuse sets that cannot say it, with
//! the reason.

#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::indexing_slicing,
        clippy::unreachable,
        clippy::todo
    )
)]

#[cfg(test)]
extern crate std;

pub mod accelerometer;
pub mod ellipsoid;
pub mod field;
pub mod known_attitudes;
pub mod six_position;
pub mod statistics;
pub mod still;

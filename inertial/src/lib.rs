//! Orientation of the three-axis block: what happens after a fix, when the instrument moves.
//!
//! Block axes: x forward along the mark, y left, z up. Geographic axes: east, north, up. An orientation takes a vector from
//! block axes to geographic ones. Angles inside are radians, rotations are rotation vectors; increments come from 100 Hz
//! samples and are turned into rotations by `coning`, summed up by `quaternion`, and read as heading, pitch and roll by
//! `rotation`. All of it is f64 with `libm`, so that host and target agree bit for bit.

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

pub mod alignment;
pub mod coning;
pub mod esg;
pub mod filter;
pub mod hold;
pub mod quaternion;
pub mod rotation;
pub mod ud;

pub use alignment::{AlignError, Aligned, Alignment, BaseMotion, NoiseOfRate};
pub use coning::{Algorithm, Increment, Integrator, LONGEST_SAMPLE_S};
pub use hold::{BlockClass, Hold, HoldCounters, HoldLimits, HoldSecond, Motion, Stood};
pub use quaternion::Quaternion;
pub use rotation::Angles;

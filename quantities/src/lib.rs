//! What the crates of a gyro north finder have in common: units and the Earth, readings as whole numbers, limits of values, and two small
//! functions, median and outer product.

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

pub mod codes;
pub mod earth;
pub mod limits;
pub mod median;
pub mod outer;
pub mod units;

//! A gyro north finder: a single-axis fibre-optic gyro on a vertical spindle, turned through a few index positions,
//! finds true north from the Earth's rotation.
//!
//! Conventions, everywhere: azimuth ψ of the index-zero mark, clockwise from true north; index angle θ of the gyro's
//! sensitive axis about the spindle, counter-clockwise from above, 0 at the mark; instrument axes x forward along the
//! mark, y left, z up; a level and still accelerometer triad reads (0, 0, +1) g; rates in °/h, increments in arcsec.

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

pub mod attitude;
mod bounded;
pub mod bytes;
pub mod calibration;
pub mod codes;
pub mod drivers;
pub mod earth;
pub mod effects;
pub mod event;
pub mod fix;
pub mod frame;
pub mod gates;
pub mod gather;
pub mod guard;
pub mod heading;
pub mod health;
pub mod identity;
pub mod index;
pub mod instrument;
pub mod intake;
pub mod level;
pub mod limits;
pub mod link;
pub mod median;
pub mod nmea;
pub mod outer;
pub mod raw;
pub mod replay;
pub mod restart;
pub mod ring;
pub mod ripple;
pub mod sample;
pub mod self_test;
pub mod sequence;
pub mod settings;
pub mod units;
pub mod watch;

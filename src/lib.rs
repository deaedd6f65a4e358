//! A gyro north finder: a single-axis fibre-optic gyro on a vertical spindle, turned through a few index positions,
//! finds true north from the Earth's rotation.
//!
//! Conventions, everywhere: azimuth ψ of the index-zero mark, clockwise from true north; index angle θ of the gyro's
//! sensitive axis about the spindle, counter-clockwise from above, 0 at the mark; instrument axes x forward along the
//! mark, y left, z up; a level and still accelerometer triad reads (0, 0, +1) g; rates in °/h, increments in arcsec.
//!
//! In the order of use:
//!
//! | module | from what | to what |
//! |---|---|---|
//! | [`sensing`] | bytes of the gyro, readings of accelerometers and encoder | one second: rate, tilt, index angle, and whether it is good |
//! | [`effects`] | conditions of a second: index, temperature, time, … | what is to be expected of the rate: the error model |
//! | [`fix`] | seconds and dwells | azimuth, sigma, misfit, flags; the heading that is held after it |
//! | [`sequence`] | seconds and the state of the motor | when to level, wait, turn, measure and solve |
//! | [`instrument`] | all of these | one step of the instrument, live or replayed |
//! | [`settings`] | bytes in flash, values of a person | settings that were checked |
//! | [`health`] | what went wrong | faults, flags and counters with stable names |
//! | [`event`] | what has happened | the reports of the instrument |
//! | [`link`] | requests and reports | bytes on the serial line |
//! | [`drivers`] | SPI devices, motor pins, serial lines | the readings of a board |
//!
//! Units and the Earth are in the crate `north-quantities`, which is given on from here; orientation is in `north-inertial`, calibrations in
//! `north-calibration`. Where to begin: the examples `solve_rows`, `replay_recording`, `own_driver`, `own_effect`, `own_board`.

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

mod bounded;
pub mod drivers;
pub mod effects;
pub mod event;
pub mod fix;
pub mod health;
pub mod instrument;
pub mod link;
pub mod sensing;
pub mod sequence;
pub mod settings;

#[doc(no_inline)]
pub use quantities::{earth, units};

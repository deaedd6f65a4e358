//! Drivers of the instrument's parts, over embedded-hal 1.0, and what a board keeps of its lines: the same code on the board, in QEMU and in process.

pub mod adis16505;
pub mod adxl355;
pub mod analogue;
pub mod as5048a;
pub mod intake;
#[cfg(test)]
mod mock;
pub mod ring;
pub mod sensors;
pub mod step_motor;

//! An electrostatic gyro beside the block: its rotor's momentum keeps a direction among the stars but for a slow drift, and so
//! bounds the heading for as long as that drift is known.
//!
//! A virtual gyro with the modelled drift runs beside the real one (`reference`); where the real rotor points is read in the
//! block's axes, and its difference from the virtual one is a measurement of two components ([`filter`]). Inertial axes here are
//! those fixed to the Earth (z along its axis, x through Greenwich) at time zero.

pub mod filter;
pub mod reference;
pub mod sky;

#[cfg(test)]
mod tests;

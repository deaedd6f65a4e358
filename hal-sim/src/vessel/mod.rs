//! A ship and what it carries, simulated in Earth-centred Cartesian coordinates: the truth for the aided filter and for the
//! electrostatic gyro.
//!
//! Positions and velocities are vectors in axes fixed to the Earth (z along its axis, x through Greenwich); "up" is the normal
//! of the ellipsoid; rates come from rotation matrices a step apart, specific force from differences of velocity. Nothing here
//! knows of geographic rates, of error equations, or of a filter.

pub mod block;
pub mod electrostatic;
pub mod globe;
pub mod satellites;
pub mod ship;
pub mod water;

//! The north finder's instrument and the world around it, simulated at the level of its buses.
//!
//! Time goes in slots of 312.5 µs, eight to a tick of 2.5 ms; nothing reads a clock. One tick is: eight times motor pins and
//! [`World::advance_slot`], then [`World::sample`], then the bytes that have arrived are read from [`World::gyro`].
//!
//! The plant works from three-dimensional geometry only and shares no formula, constant, encoder or decoder with the
//! firmware: a mistake in one is not hidden by the same mistake in the other.

mod accelerometer;
mod adis16505;
mod analogue;
mod base;
pub mod block;
mod carry;
mod device;
mod encoder;
pub mod flash;
pub mod frames;
mod geometry;
mod gyro;
mod gyro_output;
mod hand;
mod kvh_console;
mod line;
mod motor;
mod noise;
mod operator;
mod plant;
mod played;
mod pose;
pub mod scenario;
pub mod seconds;
mod thermal;
pub mod triad;
mod truth;
pub mod vessel;
mod window;
mod world;

pub use device::{AccelerometerSpi, AnalogueInputs, BlockSpi, EncoderSpi, Flash, GyroLine, Pin};
pub use operator::Operator;
pub use played::Played;
pub use scenario::{Group, Scenario, ScenarioError};
pub use truth::Truth;
pub use world::World;

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct ReadmeExample;

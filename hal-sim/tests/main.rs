//! The simulated instrument and its world, in one test program.

mod accelerometer;
mod block;
mod common;
mod describe;
mod encoder;
mod flash;
mod frames;
mod gyro_effects;
mod line;
mod motor;
mod noise;
mod operator;
mod scenarios;
mod seconds;
mod signs;
mod triad;
mod worlds;

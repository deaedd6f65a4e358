//! What crosses the modules, as one test program.

mod accuracy;
mod adaptive;
mod any_bytes;
mod architecture;
mod calibration;
mod carried;
mod common;
mod constants;
mod diagnose;
mod documents;
mod field;
mod figures;
mod frames;
mod hidden_effects;
mod index_slips;
mod page;
mod panics;
mod parked_vehicle;
mod qemu;
mod recordings;
mod replay;
mod rotation;
mod scenarios;
mod self_test;
mod states;

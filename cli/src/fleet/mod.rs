//! Fleets: what the instruments of one type have in common, learned from single ones, and which of them are not like the others.
//!
//! [`sources`] reads → `candidates` makes effects of different units comparable → `mixture` learns by expectation and maximisation → `file` keeps.
//! `campaigns` diagnoses many of them, one after the other on every core, and does nothing twice.

mod campaigns;
mod candidates;
mod file;
mod learn;
mod map;
mod mixture;
mod project;
pub mod report;
mod unit;

pub use campaigns::{Job, Outcome, diagnose_all, jobs, write_table};
pub use file::{Fleet, HasEffect, OtherEffect, Shared, UnitRecord};
pub use learn::learn;
pub use map::cores;
pub use unit::{Source, sources};

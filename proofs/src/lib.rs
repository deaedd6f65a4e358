//! The proofs: everything that measures what the north finder claims, and nothing that a user runs to find north.
//!
//! Effects are hidden here that the diagnosis is to find, and only here is known what they are: no code that diagnoses
//! depends on this crate. `north bench` runs its program in a checkout.

pub mod accuracy;
pub mod any_bytes;
pub mod bench;
pub mod composed;
pub mod faults;
pub mod hidden;
pub mod judge;
pub mod statistics;
pub mod trials;

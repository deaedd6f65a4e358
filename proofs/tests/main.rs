//! The generators and trials behind the proofs, in one test program.

mod aided;
mod command_line;
mod hidden;

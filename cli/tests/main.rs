//! The command, as its users run it, in one test program.

mod aiding;
mod attitude;
mod board;
mod calibrate;
mod campaign;
mod command_line;
mod common;
mod export;
mod field;
mod fleet;
mod hard_to_break;
mod import;
mod link;
mod pages;
mod port;
mod report;
mod researcher;
mod schema;
mod update;
mod watch;

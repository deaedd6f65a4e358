//! The reference instrument's wires as data: one netlist, and what is made of it.

pub mod check;
pub mod drawing;
pub mod netlist;
pub mod power;
pub mod table;

use std::path::{Path, PathBuf};

use netlist::{Netlist, ReadError};

/// The netlist, as it is beside these sources.
pub const INSTRUMENT: &str = include_str!("../instrument.toml");

/// What is made of a netlist: files by their paths in the checkout, and what is wrong.
pub struct Outcome {
    pub files: Vec<(&'static str, String)>,
    pub faults: Vec<String>,
}

/// The checkout.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

pub fn outcome() -> Result<Outcome, ReadError> {
    let netlist = Netlist::read(INSTRUMENT)?;
    let files = vec![
        ("docs/wiring.md", table::document(&netlist)),
        ("docs/wiring.svg", drawing::svg(&netlist)),
        ("hardware/bom.csv", table::bill(&netlist)),
    ];
    Ok(Outcome { files, faults: check::faults(&netlist) })
}

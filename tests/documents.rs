//! The documents say what the code says.

use std::fmt::Write;

use north_finder::health::{Fault, Flag};

/// The table of docs/formats.md for one enum of codes.
fn table(rows: impl Iterator<Item = (u8, &'static str, &'static str, &'static str)>) -> String {
    rows.fold("| code | name | meaning | what to do |\n|---|---|---|---|\n".to_owned(), |mut table, row| {
        let (code, name, meaning, remedy) = row;
        writeln!(table, "| {code} | `{name}` | {meaning} | {remedy} |").unwrap();
        table
    })
}

#[test]
fn flags_and_faults_are_documented_as_they_are() {
    let formats = include_str!("../docs/formats.md");
    let flags = table(Flag::ALL.iter().map(|flag| (flag.code(), flag.name(), flag.meaning(), flag.remedy())));
    let faults = table(Fault::ALL.iter().map(|fault| (fault.code(), fault.name(), fault.meaning(), fault.remedy())));
    assert!(formats.contains(&flags), "docs/formats.md lacks this table of flags:\n{flags}");
    assert!(formats.contains(&faults), "docs/formats.md lacks this table of faults:\n{faults}");
}

//! Makes docs/wiring.md, docs/wiring.svg and hardware/bom.csv of hardware/instrument.toml; or says what is wrong with it.

use std::process::ExitCode;
use std::{fs, io};

use hardware::{Outcome, outcome, root};

fn main() -> ExitCode {
    match outcome() {
        Ok(Outcome { files, faults }) if faults.is_empty() => match write(&files) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("hardware: {error}");
                ExitCode::FAILURE
            }
        },
        Ok(Outcome { faults, .. }) => {
            faults.iter().for_each(|fault| eprintln!("hardware/instrument.toml: {fault}"));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("hardware/instrument.toml: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write(files: &[(&'static str, String)]) -> io::Result<()> {
    for (name, text) in files {
        fs::write(root().join(name), text)?;
        println!("{name}");
    }
    Ok(())
}

//! What several tests of the command need: a call of it, and a board that it serves.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// The command with these arguments and nothing on its standard input.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_north"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Exit code, stdout and stderr of the command.
pub fn north(arguments: &[&str]) -> (i32, String, String) {
    let output = command(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// A board of the host engine, which is switched off when the test ends, however it ends.
pub struct Board {
    process: Child,
    pub port: String,
}

impl Board {
    pub fn on(arguments: &[&str]) -> Self {
        let board = [&["board", "--engine", "host"], arguments].concat();
        let mut process = command(&board).stdout(Stdio::piped()).spawn().unwrap();
        let mut port = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut port).unwrap();
        Self { process, port: port.trim().to_owned() }
    }

    /// Switches it off: the line breaks.
    pub fn switch_off(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.switch_off();
    }
}

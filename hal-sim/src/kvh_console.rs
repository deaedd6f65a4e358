//! The console of a gyro of KVH's family: lines of text that change what its frames hold.
//!
//! Written from KVH's technical manual of the 1775 IMU, 56-0298 revision B: 3.3 (modes), 8 (commands), 10.3 (synchronisation).

use crate::scenario::{Gyro, GyroFormat};

/// What its frames hold, and when they come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    pub rates: bool,
    pub degrees: bool,
    /// By its own clock, 1000 frames a second.
    pub own_clock: bool,
}

/// Longest line that it takes.
const LONGEST: usize = 80;
/// Data rates that it accepts, Hz.
const DATA_RATES: [&str; 12] = ["1", "5", "10", "25", "50", "100", "250", "500", "750", "1000", "3600", "5000"];

/// The console and what was set at it.
#[derive(Debug, Clone)]
pub struct Console {
    output: Output,
    listens: bool,
    /// In the configuration mode, in which no frames come.
    configuring: bool,
    line: Vec<u8>,
}

impl Console {
    /// As somebody left it.
    pub fn new(gyro: &Gyro) -> Self {
        let output = Output { rates: gyro.rates, degrees: gyro.degrees, own_clock: gyro.own_clock };
        let listens = gyro.listens && gyro.format == GyroFormat::KvhA;
        Self { output, listens, configuring: false, line: Vec::new() }
    }

    pub fn output(&self) -> Output {
        self.output
    }

    pub fn sends_frames(&self) -> bool {
        !self.configuring
    }

    /// Takes a byte; gives what it answers.
    pub fn hear(&mut self, byte: u8) -> Option<String> {
        if !self.listens {
            return None;
        }
        if byte != b'\n' {
            if self.line.len() < LONGEST {
                self.line.push(byte.to_ascii_uppercase());
            }
            return None;
        }
        let line = std::mem::take(&mut self.line);
        let line = String::from_utf8_lossy(&line);
        self.obey(line.trim().strip_prefix('=')?)
    }

    fn obey(&mut self, command: &str) -> Option<String> {
        let (name, value) = command.split_once(',')?;
        if name == "CONFIG" {
            self.configuring = value == "1";
            return self.configuring.then(|| format!("{command}\r\n"));
        }
        if !self.configuring {
            return None;
        }
        let output = &mut self.output;
        let known = match (name, value) {
            ("ROTFMT", "DELTA" | "RATE") => {
                output.rates = value == "RATE";
                true
            }
            ("ROTUNITS", "RAD" | "DEG") => {
                output.degrees = value == "DEG";
                true
            }
            ("MSYNC", "EXT" | "IMU") => {
                output.own_clock = value == "IMU";
                true
            }
            ("DR", value) => DATA_RATES.contains(&value),
            _ => false,
        };
        Some(if known { format!("{command}\r\n") } else { "INVALID\r\n".into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn say(console: &mut Console, line: &str) -> String {
        line.bytes().filter_map(|byte| console.hear(byte)).collect()
    }

    #[test]
    fn it_is_set_in_its_configuration_mode_only() {
        let gyro = Gyro { format: GyroFormat::KvhA, rates: true, degrees: true, own_clock: true, ..Gyro::default() };
        let mut console = Console::new(&gyro);
        assert_eq!(say(&mut console, "=rotfmt,delta\r\n"), "");
        assert!(console.output().rates && console.sends_frames());
        assert_eq!(say(&mut console, "=config,1\r\n"), "CONFIG,1\r\n");
        assert!(!console.sends_frames());
        for (line, answer) in [
            ("=rotfmt,delta\r\n", "ROTFMT,DELTA\r\n"),
            ("=ROTUNITS,RAD\n", "ROTUNITS,RAD\r\n"),
            ("=DR,400\r\n", "INVALID\r\n"),
            ("=DR,500\r\n", "DR,500\r\n"),
            ("=MSYNC,EXT\r\n", "MSYNC,EXT\r\n"),
            ("=CONFIG,0\r\n", ""),
        ] {
            assert_eq!(say(&mut console, line), answer, "{line}");
        }
        assert_eq!(console.output(), Output { rates: false, degrees: false, own_clock: false });
        assert!(console.sends_frames());
    }
}
